//! Derivatives against differences, and small bodies whose answer is known.

use super::{newton::Potential, *};
use crate::geom::{TetMesh, lattice::block_of_cells};
use glam::{DMat3, DQuat, DVec3, Vec3};
use proptest::prelude::*;

const TISSUE: Material = Material {
    mu_pa: 3.0e3,
    lambda_pa: 2.0e4,
};

/// A body of density 1000 kg/m³ in cells of 1 cm.
struct Block {
    tets: TetMesh,
    masses_kg: Vec<f32>,
    fixed: Vec<bool>,
}

impl Block {
    fn new(cells: [usize; 3], fixed: impl Fn(Vec3) -> bool) -> Self {
        let size = 0.01 * Vec3::from_array(cells.map(|n| n as f32));
        let lattice = block_of_cells(size, cells).1;
        Self {
            masses_kg: lattice.masses_kg.iter().map(|m| 1000.0 * m).collect(),
            fixed: lattice.tets.particles.iter().map(|&x| fixed(x)).collect(),
            tets: lattice.tets,
        }
    }

    fn fem(&self, material: Material, gravity_m_s2: DVec3) -> Fem {
        Fem::new(&FemSetup {
            tets: &self.tets,
            masses_kg: &self.masses_kg,
            fixed: &self.fixed,
            fill: &[],
            material,
            gravity_m_s2,
        })
    }
}

/// `rest` with every particle moved by up to 3 mm, in ways that depend on `seed`.
fn shaken(rest: &[DVec3], seed: [f64; 3]) -> Vec<DVec3> {
    (rest.iter().enumerate())
        .map(|(i, x)| {
            let phase = i as f64 * DVec3::new(1.7, 2.9, 4.3) + DVec3::from_array(seed);
            *x + 3e-3 * DVec3::new(phase.x.sin(), phase.y.sin(), phase.z.sin())
        })
        .collect()
}

fn along(positions: &[DVec3], direction: &[DVec3], share: f64) -> Vec<DVec3> {
    (positions.iter().zip(direction))
        .map(|(x, d)| *x + share * *d)
        .collect()
}

/// Differences between the work of the force and the slope of the energy, and between the stiffness
/// and the slope of the force, along one direction, over the size of either; the stiffness is that of
/// `stiffness_of`.
fn derivative_errors(material: Material, stiffness_of: Material, seed: [f64; 3]) -> (f64, f64) {
    let block = Block::new([2, 2, 1], |x| x.x < 1e-6);
    let fem = block.fem(material, DVec3::ZERO);
    let x = shaken(fem.rest(), seed);
    let mut direction = shaken(&vec![DVec3::ZERO; x.len()], seed.map(|s| 2.0 * s + 1.0));
    for (d, fixed) in direction.iter_mut().zip(&block.fixed) {
        *d = if *fixed { DVec3::ZERO } else { *d };
    }
    let step = 1e-4;
    let (ahead, behind) = (along(&x, &direction, step), along(&x, &direction, -step));
    let slope = (fem.elastic_energy_j(&ahead) - fem.elastic_energy_j(&behind)) / (2.0 * step);
    let work: Vec<f64> = (fem.elastic_forces_n(&x).iter().zip(&direction))
        .map(|(force, d)| -force.dot(*d))
        .collect();
    let (sum, work_size) = work
        .iter()
        .fold((0.0, 0.0), |(sum, size), w| (sum + w, size + w.abs()));

    let (f_ahead, f_behind) = (fem.elastic_forces_n(&ahead), fem.elastic_forces_n(&behind));
    let stiff = block.fem(stiffness_of, DVec3::ZERO);
    let product = times_stiffness(&stiff, &x, &direction);
    let (mut wrong, mut size) = (0.0, 0.0);
    for (row, &particle) in stiff.free_particles().iter().enumerate() {
        let i = particle as usize;
        let exact = (f_behind[i] - f_ahead[i]) / (2.0 * step);
        wrong += (product[row] - exact).length_squared();
        size += exact.length_squared();
    }
    ((sum - slope).abs() / work_size, (wrong / size).sqrt())
}

/// Stiffness times `direction`, one row a free particle.
fn times_stiffness(fem: &Fem, x: &[DVec3], direction: &[DVec3]) -> Vec<DVec3> {
    let mut values = Vec::new();
    fem.stiffness(x, &mut values);
    let free = fem.free_particles();
    let dofs = 3 * free.len();
    let at = |dof: usize| direction[free[dof / 3] as usize][dof % 3];
    let mut product = vec![DVec3::ZERO; free.len()];
    for column in 0..dofs {
        for (row, place) in fem.pattern().column(column) {
            product[row / 3][row % 3] += values[place] * at(column);
            if row != column {
                product[column / 3][column % 3] += values[place] * at(row);
            }
        }
    }
    product
}

proptest! {
    #[test]
    fn force_is_the_slope_of_the_energy_and_stiffness_that_of_the_force(
        seed in prop::array::uniform3(0.0_f64..6.0),
    ) {
        let (force, stiffness) = derivative_errors(TISSUE, TISSUE, seed);
        // Central differences over 3e-7 m of a cell of 1e-2 m: (3e-5)² from the third derivative,
        // 1e-16/3e-5 from rounding, both a hundred times that where the parts of a force cancel.
        prop_assert!(force < 1e-6, "force {force}");
        prop_assert!(stiffness < 1e-6, "stiffness {stiffness}");
    }

    #[test]
    fn energy_and_forces_do_not_change_in_a_rigid_motion(
        seed in prop::array::uniform3(0.0_f64..6.0), angle in -3.0_f64..3.0,
    ) {
        let block = Block::new([2, 1, 1], |_| false);
        let fem = block.fem(TISSUE, DVec3::ZERO);
        let x = shaken(fem.rest(), seed);
        let turn = DQuat::from_axis_angle(DVec3::from_array(seed).normalize_or(DVec3::X), angle);
        let moved: Vec<DVec3> = x.iter().map(|x| turn * *x + DVec3::new(0.2, -0.1, 0.3)).collect();
        let energy = fem.elastic_energy_j(&x);
        // Rounding of coordinates 0.3 m from the origin, 3e-17, against strains of 0.3 over 1e-2 m.
        prop_assert!((fem.elastic_energy_j(&moved) / energy - 1.0).abs() < 1e-12);
        let scale = fem.elastic_forces_n(&x).iter().map(|f| f.length()).fold(0.0, f64::max);
        for (before, after) in fem.elastic_forces_n(&x).iter().zip(fem.elastic_forces_n(&moved)) {
            prop_assert!((turn * *before - after).length() < 1e-12 * scale);
        }
    }
}

#[test]
fn derivative_check_rejects_a_stiffness_of_another_material() {
    let softer = Material {
        mu_pa: 0.95 * TISSUE.mu_pa,
        ..TISSUE
    };
    let (_, stiffness) = derivative_errors(TISSUE, softer, [1.0, 2.0, 3.0]);
    assert!(stiffness > 1e-3, "5 % of μ changed it by only {stiffness}");
}

#[test]
fn small_strains_give_the_stress_of_linear_elasticity() {
    let strain = 1e-6
        * DMat3::from_cols(
            DVec3::new(0.3, 0.7, -0.2),
            DVec3::new(0.7, -0.5, 0.4),
            DVec3::new(-0.2, 0.4, 0.9),
        );
    let trace = strain.x_axis.x + strain.y_axis.y + strain.z_axis.z;
    let hooke =
        2.0 * TISSUE.mu_pa * strain + DMat3::from_diagonal(DVec3::splat(TISSUE.lambda_pa * trace));
    let off = TISSUE.stress(DMat3::IDENTITY + strain) - hooke;
    let size = |m: DMat3| m.to_cols_array().iter().map(|v| v * v).sum::<f64>().sqrt();
    // The next order of the strain is 1e-6 of this one.
    assert!(size(off) < 1e-5 * size(hooke), "{off}");
    assert!(size(TISSUE.stress(DMat3::IDENTITY)) == 0.0);
}

#[test]
fn body_that_nothing_holds_has_no_equilibrium_under_gravity() {
    let block = Block::new([1, 1, 1], |_| false);
    let found = block.fem(TISSUE, DVec3::new(0.0, -9.81, 0.0)).statics();
    let residual = found.expect_err("it falls").residual;
    assert!(residual > 0.1, "{residual}");
}

#[test]
fn flat_and_inverted_tetrahedra_and_loose_particles_change_nothing() {
    let mut block = Block::new([3, 1, 1], |x| x.x < 1e-6);
    let down = DVec3::new(0.0, -9.81, 0.0);
    let sound = block.fem(TISSUE, down).statics().expect("it settles");
    let [a, b, c, d] = block.tets.tets[0];
    block.tets.tets.extend([[a, a, b, c], [b, a, c, d]]);
    block.tets.particles.push(Vec3::splat(0.5));
    block.masses_kg.push(1.0);
    block.fixed.push(false);
    let other = block.fem(TISSUE, down).statics().expect("it settles");
    assert_eq!(sound.positions, other.positions[..sound.positions.len()]);
}

#[test]
fn fixed_particles_that_are_held_elsewhere_pull_the_body_along() {
    let block = Block::new([4, 1, 1], |x| x.x < 1e-6 || x.x > 0.0399);
    let mut fem = block.fem(TISSUE, DVec3::ZERO);
    let shift = DVec3::new(0.01, 0.02, -0.03);
    for i in 0..fem.rest().len() {
        if block.fixed[i] {
            fem.hold(i, fem.rest()[i] + shift);
        }
    }
    let there = fem.statics().expect("a shifted body is in equilibrium");
    for (x, rest) in there.positions.iter().zip(fem.rest()) {
        assert!(x.distance(*rest + shift) < 1e-12);
    }
}

#[test]
fn free_fall_is_exact_and_damping_acts_once_a_frame() {
    let block = Block::new([1, 1, 1], |_| false);
    let fem = block.fem(TISSUE, DVec3::new(0.0, -9.81, 0.0));
    let swing = Swing {
        frames: 3,
        frame_s: 0.01,
        steps_per_frame: 4,
        damping_per_s: 20.0,
    };
    // The midpoint rule is exact for a constant acceleration.
    let (mut height, mut speed) = (0.0, 0.0);
    fem.swing(fem.at_rest(), &swing, |frame, state| {
        height += speed * 0.01 + 9.81 * 0.01 * 0.01 / 2.0;
        speed = (speed + 9.81 * 0.01) * (-0.2_f64).exp();
        for (x, rest) in state.positions.iter().zip(fem.rest()) {
            let fallen = x.distance(*rest - DVec3::Y * height);
            assert!(fallen < 1e-12, "frame {frame}: off by {fallen} m");
        }
        for v in &state.velocities {
            assert!(v.distance(-speed * DVec3::Y) < 1e-10, "frame {frame}: {v}");
        }
    })
    .expect("every step has a solution");
}

/// Largest change of the energy of a free swing, over what gravity has to give.
fn energy_drift(steps_per_frame: usize, damping_per_s: f64) -> f64 {
    let block = Block::new([4, 1, 1], |x| x.x < 1e-6);
    let fem = block.fem(TISSUE, DVec3::new(0.0, -9.81, 0.0));
    let swing = Swing {
        frames: 30,
        frame_s: 1.0 / 60.0,
        steps_per_frame,
        damping_per_s,
    };
    let weight = 9.81 * block.masses_kg.iter().map(|&m| f64::from(m)).sum::<f64>();
    let mut drift = 0.0_f64;
    fem.swing(fem.at_rest(), &swing, |_, state| {
        drift = drift.max(fem.energy_j(state).abs() / (weight * 0.01));
    })
    .expect("every step has a solution");
    drift
}

#[test]
fn energy_of_a_free_swing_comes_back_and_better_so_in_shorter_steps() {
    let (long, short) = (energy_drift(8, 0.0), energy_drift(16, 0.0));
    println!("energy off by {long:.2e} of the fall at 8 steps a frame, {short:.2e} at 16");
    // A symplectic rule of second order: the energy swings by a share of (ωh)² and does not drift.
    assert!(short < 1e-3, "{short}");
    assert!((2.5..6.0).contains(&(long / short)), "{}", long / short);
}

#[test]
fn energy_check_sees_one_per_cent_of_damping() {
    let damped = energy_drift(16, 0.6);
    assert!(damped > 5e-3, "1 % a frame took only {damped}");
}

#[test]
fn newton_goes_through_an_indefinite_stiffness() {
    // Squeezed to a third, the tissue is unstable: the plain stiffness is no direction to descend.
    let block = Block::new([2, 1, 1], |x| x.x < 1e-6);
    let fem = block.fem(TISSUE, DVec3::ZERO);
    let mut x: Vec<DVec3> = (fem.rest().iter())
        .map(|x| DVec3::new(0.3 * x.x, 0.9 * x.y, -0.8 * x.z))
        .collect();
    fem.put_held(&mut x, 1.0);
    let potential = Potential {
        fem: &fem,
        load_share: 1.0,
        inertia: None,
    };
    let ended = potential.minimise(&mut x, 1e-12);
    assert!(ended.residual_n <= 1e-12, "{ended:?}");
    for (x, rest) in x.iter().zip(fem.rest()) {
        assert!(x.distance(*rest) < 1e-9, "{x} for {rest}");
    }
}
