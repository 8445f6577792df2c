//! The stress kernel against a solve of its equations, and what must hold for any of its inputs.

use super::*;
use crate::sim::{Method, constraint};
use glam::{DVec3, Vec3, Vec3Swizzles};
use proptest::prelude::*;

const PARAMS: SolverParams = SolverParams {
    method: Method::XpbdNeoHookean,
    timestep_s: 1e-3,
    substeps: 1,
    iterations: 1,
    youngs_modulus_pa: 6e3,
    poisson_ratio: 0.45,
};

/// Eight tetrahedra side by side, none sharing a particle, each moved by three of `moves`.
fn eight(moves: &[f32]) -> (TetMesh, Vec<Vec4>) {
    let mut mesh = TetMesh::default();
    let mut places = Vec::new();
    for lane in 0..LANES {
        let first = mesh.particles.len() as u32;
        for corner in [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z] {
            let rest = 0.01 * (corner + 0.2 * corner.yzx());
            let k = 3 * mesh.particles.len();
            let moved = rest + 0.008 * Vec3::from_slice(&moves[k..k + 3]);
            mesh.particles.push(rest);
            places.push(moved.extend(1e4 * (1.0 + corner.x + lane as f32)));
        }
        mesh.tets.push([first, first + 1, first + 2, first + 3]);
    }
    add_spare(&mut places);
    (mesh, places)
}

fn model(mesh: &TetMesh) -> NeoHookean {
    let all: Vec<u32> = (0..mesh.tets.len() as u32).collect();
    NeoHookean::new(mesh, &all, &vec![1.0; mesh.tets.len()])
}

fn sweep(model: &mut NeoHookean, places: &mut [Vec4], params: &SolverParams) {
    model.begin_substep(&Team::alone(), places, params);
    model.project(&Team::alone(), places);
}

/// Solves nine equations, given the columns of their matrix, by Gauss and Jordan with pivots.
fn solved(mut columns: [[f64; 9]; 9], mut right: [f64; 9]) -> [f64; 9] {
    for step in 0..9 {
        let pivot = (step..9)
            .max_by(|&a, &b| columns[step][a].abs().total_cmp(&columns[step][b].abs()))
            .expect("there are rows left");
        columns
            .iter_mut()
            .for_each(|column| column.swap(step, pivot));
        right.swap(step, pivot);
        for row in (0..9).filter(|&row| row != step) {
            let factor = columns[step][row] / columns[step][step];
            for column in &mut columns {
                column[row] -= factor * column[step];
            }
            right[row] -= factor * right[step];
        }
    }
    std::array::from_fn(|row| right[row] / columns[row][row])
}

/// One projection of one tetrahedron from nothing, by the formulas at the head of the module, in
/// f64 and with a 9×9 solve instead of the closed form.
fn projected(mesh: &TetMesh, tet: usize, places: &[Vec4], params: &SolverParams) -> [DVec3; 4] {
    let [a, b, c, d] = mesh.tets[tet].map(|i| mesh.particles[i as usize].as_dvec3());
    let rest_inverse = DMat3::from_cols(b - a, c - a, d - a).inverse();
    let volume = 1.0 / (6.0 * rest_inverse.determinant());
    let rows = rest_inverse.transpose();
    let gradients = [
        -(rows.x_axis + rows.y_axis + rows.z_axis),
        rows.x_axis,
        rows.y_axis,
        rows.z_axis,
    ];
    let x = mesh.tets[tet].map(|i| places[i as usize].truncate().as_dvec3());
    let w = mesh.tets[tet].map(|i| f64::from(places[i as usize].w));
    let outer = |x: DVec3, y: DVec3| DMat3::from_cols(x * y.x, x * y.y, x * y.z);
    let f: DMat3 = (0..4).map(|k| outer(x[k], gradients[k])).sum();
    let mobility: DMat3 = (0..4)
        .map(|k| outer(gradients[k], gradients[k]) * w[k])
        .sum();
    let lame = params.lame();
    let cofactor = DMat3::from_cols(
        f.y_axis.cross(f.z_axis),
        f.z_axis.cross(f.x_axis),
        f.x_axis.cross(f.y_axis),
    );
    let h2v = f64::from(params.substep_s()).powi(2) * volume;
    let shear = f64::from(STIFFNESS_IN_MU * lame.mu_pa);
    let bulk = f64::from(lame.mu_pa + lame.lambda_pa);
    let own = f64::from(OWN_RESPONSE);
    let inner = |a: DMat3, b: DMat3| -> f64 {
        let (a, b) = (a.to_cols_array(), b.to_cols_array());
        (0..9).map(|k| a[k] * b[k]).sum()
    };
    let system = |column: usize| -> [f64; 9] {
        let mut unit = [0.0; 9];
        unit[column] = 1.0;
        let moved = DMat3::from_cols_array(&unit) * mobility;
        let stress = moved * shear + cofactor * (bulk * inner(cofactor, moved));
        let stress = stress.to_cols_array();
        std::array::from_fn(|row| f64::from(u8::from(row == column)) + own * h2v * stress[row])
    };
    let misfit = constraint::stress_pa(f, lame).to_cols_array();
    let change = DMat3::from_cols_array(&solved(std::array::from_fn(system), misfit));
    std::array::from_fn(|k| x[k] - change * gradients[k] * (h2v * w[k]))
}

/// Worst distance between kernel and formulas over eight tetrahedra [m].
fn worst_difference_m(moves: &[f32], params: &SolverParams) -> f64 {
    let (mesh, mut places) = eight(moves);
    let expected: Vec<[DVec3; 4]> = (0..LANES)
        .map(|tet| projected(&mesh, tet, &places, &PARAMS))
        .collect();
    sweep(&mut model(&mesh), &mut places, params);
    let mut worst = 0.0_f64;
    for (tet, expected) in expected.iter().enumerate() {
        for k in 0..4 {
            let found = places[mesh.tets[tet][k] as usize].truncate().as_dvec3();
            worst = worst.max(found.distance(expected[k]));
        }
    }
    worst
}

/// Edges are 1 cm and corrections up to some of them; single precision keeps six digits of each.
const TOLERANCE_M: f64 = 1e-6;

proptest! {
    #[test]
    fn kernel_moves_corners_as_a_solve_of_the_nine_equations_does(
        moves in prop::collection::vec(-1.0_f32..1.0, 12 * LANES),
    ) {
        let worst = worst_difference_m(&moves, &PARAMS);
        prop_assert!(worst < TOLERANCE_M, "{worst} m");
    }

    #[test]
    fn a_sweep_leaves_the_centre_of_mass_where_it_was(
        moves in prop::collection::vec(-1.0_f32..1.0, 12 * LANES),
    ) {
        let (mesh, mut places) = eight(&moves);
        let centre = |places: &[Vec4]| -> DVec3 {
            (places[..4].iter())
                .map(|x| x.truncate().as_dvec3() / f64::from(x.w))
                .sum::<DVec3>()
                / places[..4].iter().map(|x| 1.0 / f64::from(x.w)).sum::<f64>()
        };
        let before = centre(&places);
        sweep(&mut model(&mesh), &mut places, &PARAMS);
        // Four corrections of up to some centimetres, rounded to seven digits.
        prop_assert!(centre(&places).distance(before) < 1e-8);
    }
}

fn some_moves() -> Vec<f32> {
    (0..12 * LANES)
        .map(|i| ((i * 37) % 19) as f32 / 19.0)
        .collect()
}

#[test]
fn kernel_check_rejects_another_stiffness() {
    let softer = SolverParams {
        youngs_modulus_pa: 0.9 * PARAMS.youngs_modulus_pa,
        ..PARAMS
    };
    assert!(worst_difference_m(&some_moves(), &softer) > 10.0 * TOLERANCE_M);
}

#[test]
fn what_acts_on_accelerations_alone_leaves_places_to_the_bit() {
    let (mesh, mut places) = eight(&some_moves());
    let mut model = model(&mesh);
    model.begin_substep(&Team::alone(), &mut places, &PARAMS);
    let before = places.clone();
    let accelerations = ParticleAccess::new(&mut model.accelerations);
    let access = ParticleAccess::new(&mut places);
    for batch in model.tets.as_mut_slice() {
        // Nothing times infinity is no number.
        batch.stress[0].x = Lanes::splat(f32::INFINITY);
        batch.accelerate_anew::<false>(access, accelerations);
        batch.shed::<false>(access, accelerations, model.step);
    }
    assert_eq!(places, before);
    assert!(model.accelerations.iter().any(|a| !a.is_finite()));
}

#[test]
fn narrow_and_wide_vectors_give_the_same_bits() {
    let (mesh, places) = eight(&some_moves());
    let mut found = Vec::new();
    for wide in [false, true] {
        let (mut model, mut places) = (model(&mesh), places.clone());
        model.begin_substep(&Team::alone(), &mut places, &PARAMS);
        let step = model.step;
        let accelerations = ParticleAccess::new(&mut model.accelerations);
        let access = ParticleAccess::new(&mut places);
        for batch in model.tets.as_mut_slice() {
            #[cfg(target_arch = "x86_64")]
            if wide && std::arch::is_x86_feature_detected!("avx2") {
                batch.project::<true>(access, accelerations, None, step);
                continue;
            }
            batch.project::<false>(access, accelerations, None, step);
        }
        let _ = wide;
        found.push(places);
    }
    assert_eq!(found[0], found[1]);
}

#[test]
fn collapsed_and_coincident_corners_stay_finite() {
    for scale in [0.0, 1e-20, 1e-3] {
        let (mesh, mut places) = eight(&[0.0; 12 * LANES]);
        for place in &mut places {
            *place = (scale * place.truncate()).extend(place.w);
        }
        let mut model = model(&mesh);
        for _ in 0..10 {
            sweep(&mut model, &mut places, &PARAMS);
        }
        assert!(places.iter().all(|place| place.is_finite()), "{scale}");
    }
}

#[test]
fn what_is_carried_over_is_what_the_stresses_do() {
    let (mesh, mut places) = eight(&some_moves());
    let mut model = model(&mesh);
    for _ in 0..50 {
        sweep(&mut model, &mut places, &PARAMS);
    }
    let carried = model.accelerations.clone();
    model.ready_for = None;
    model.begin_substep(&Team::alone(), &mut places, &PARAMS);
    let largest = carried.iter().map(|a| a.length()).fold(0.0, f32::max);
    for (a, b) in carried.iter().zip(&model.accelerations) {
        // Fifty sums of single-precision increments.
        assert!((*a - *b).length() < 1e-4 * largest, "{a} {b}");
    }
}

#[test]
fn waves_that_grow_for_four_steps_make_a_body_carry_less_until_it_is_put_elsewhere() {
    let (mesh, mut places) = eight(&[0.0; 96]);
    let mut model = model(&mesh);
    model.begin_substep(&Team::alone(), &mut places, &PARAMS);
    let grown = 2.0 * GROWN_RESIDUAL;
    for residual in [
        grown,
        grown,
        grown,
        0.1 * GROWN_RESIDUAL,
        grown,
        grown,
        grown,
    ] {
        model.watch(residual);
        assert!(!matches!(model.carry, Carry::Safe(_)));
    }
    model.watch(grown);
    assert!(matches!(model.carry, Carry::Safe(_)));
    // Calm or not: what was seen once comes again.
    model.watch(0.0);
    model.begin_substep(&Team::alone(), &mut places, &PARAMS);
    assert!(matches!(model.carry, Carry::Safe(_)));
    model.forget(&mut places, &PARAMS);
    assert_eq!(model.carry, Carry::Most);
}

#[test]
fn another_time_step_forgets_that_waves_grew() {
    let (mesh, mut places) = eight(&[0.0; 96]);
    let mut model = model(&mesh);
    model.begin_substep(&Team::alone(), &mut places, &PARAMS);
    for _ in 0..GROWN_STEPS {
        model.watch(2.0 * GROWN_RESIDUAL);
    }
    model.begin_substep(&Team::alone(), &mut places, &PARAMS);
    assert!(matches!(model.carry, Carry::Safe(_)));
    let half = SolverParams {
        substeps: 2,
        ..PARAMS
    };
    model.begin_substep(&Team::alone(), &mut places, &half);
    assert_eq!(model.carry, Carry::Most);
}

#[test]
fn a_body_says_how_many_substeps_it_takes_to_carry_all_its_stress() {
    let (mesh, places) = eight(&[0.0; 96]);
    let model = model(&mesh);
    assert_eq!(model.faithful_substeps(&places, &PARAMS), None);
    let stiff = SolverParams {
        youngs_modulus_pa: 1e4 * PARAMS.youngs_modulus_pa,
        ..PARAMS
    };
    let substeps = model.faithful_substeps(&places, &stiff);
    let wanted = SolverParams {
        substeps: substeps.expect("ten thousand times as stiff is too stiff"),
        ..stiff
    };
    assert_eq!(model.faithful_substeps(&places, &wanted), None);
    let half = SolverParams {
        substeps: wanted.substeps / 2,
        ..stiff
    };
    assert!(model.faithful_substeps(&places, &half).is_some());
}

#[test]
fn a_body_with_some_light_tetrahedra_says_so_though_the_others_are_soft() {
    let (mesh, places) = eight(&[0.0; 96]);
    let model = model(&mesh);
    let stiffest = (model.stiffnesses(&places, &PARAMS).into_iter()).fold(0.0, f64::max);
    let of_limits = |share: f64| {
        let scale = share * f64::from(CARRIED_STIFFNESS_MAX[1]) / stiffest;
        // Particles of the last tetrahedron, of which every other is softer.
        let mut places = places.clone();
        for place in &mut places[28..32] {
            place.w *= scale as f32;
        }
        model.faithful_substeps(&places, &PARAMS)
    };
    // 40 for one and at most its share of `stiffest` for seven is less than 12 in the mean.
    assert_eq!(of_limits(0.9), None);
    assert_eq!(of_limits(1.1).map(|substeps| substeps > 1), Some(true));
}
