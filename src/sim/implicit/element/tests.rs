//! The kernels against the energy density in f64 of `sim::constraint`.

use super::*;
use crate::sim::{
    constraint::energy_density_pa,
    implicit::{elements::Elements, matrix::BlockMatrix},
};
use proptest::prelude::*;

const LAME: Lame = Lame {
    mu_pa: 3.4e3,
    lambda_pa: 3.1e4,
};
const ELEMENT: Element = Element {
    nodes: [0, 1, 2, 3],
    fill: 0.7,
};
/// A tetrahedron of about a centimetre [m].
const REST: [DVec3; 4] = [
    DVec3::new(0.001, 0.0, 0.0),
    DVec3::new(0.011, 0.001, 0.0),
    DVec3::new(0.002, 0.009, -0.001),
    DVec3::new(0.0, 0.002, 0.012),
];

/// Displacements of the corners under F, and none of the unused node [m].
fn displaced(f: DMat3) -> Vec<DVec4> {
    let moved = REST.map(|x| ((f - DMat3::IDENTITY) * x).extend(0.0));
    moved.into_iter().chain([DVec4::ZERO]).collect()
}

/// F from nine numbers about 0.
fn near(base: DMat3, noise: [f64; 9]) -> DMat3 {
    base + DMat3::from_cols_array(&noise)
}

/// Energy of the tetrahedron [J].
fn energy_j(displacements: &[DVec4]) -> f64 {
    let (gradients, volume_m3) = ELEMENT.shape(&REST);
    let f = (0..4).fold(DMat3::IDENTITY, |sum, k| {
        let (u, g) = (displacements[k].truncate(), gradients[k]);
        sum + DMat3::from_cols(g.x * u, g.y * u, g.z * u)
    });
    volume_m3 * energy_density_pa(f, LAME)
}

/// Derivative of `value` by coordinate `k` of the corners, by central differences.
fn slope(at: &[DVec4], k: usize, value: impl Fn(&[DVec4]) -> f64) -> f64 {
    // The best step for the second derivative in f64: the fourth root of its rounding, of 1 cm.
    const STEP_M: f64 = 1e-6;
    let mut moved = at.to_vec();
    moved[k / 3][k % 3] += STEP_M;
    let above = value(&moved);
    moved[k / 3][k % 3] -= 2.0 * STEP_M;
    (above - value(&moved)) / (2.0 * STEP_M)
}

/// The kernel's force on corner and axis `k` [N], and its energy [J].
fn kernel_forces(displacements: &[DVec4]) -> ([f64; 12], Strain) {
    forces_of(&elements().0, displacements)
}

fn forces_of(elements: &Elements, displacements: &[DVec4]) -> ([f64; 12], Strain) {
    let mut forces = vec![Vec4::ZERO; 5];
    let strain = elements.forces(displacements, LAME, &mut forces);
    let force = |k: usize| f64::from(forces[k / 3][k % 3]);
    (std::array::from_fn(force), strain)
}

/// Shortening of the tetrahedron where it is muscle, of activity 0.8.
const SHORTENING: f32 = 0.25;
const SCALE: f64 = 0.8;

/// Energy of the tetrahedron as muscle that wants to be smaller: that of the smaller shape [J].
fn pulled_energy_j(displacements: &[DVec4]) -> f64 {
    let (gradients, volume_m3) = ELEMENT.shape(&REST);
    let f = (0..4).fold(DMat3::IDENTITY, |sum, k| {
        let (u, g) = (displacements[k].truncate(), gradients[k]);
        sum + DMat3::from_cols(g.x * u, g.y * u, g.z * u)
    });
    volume_m3 * SCALE.powi(3) * energy_density_pa(f * (1.0 / SCALE), LAME)
}

/// That muscle.
fn muscle() -> (Elements, BlockMatrix) {
    let (mut elements, matrix) = elements();
    elements.set_activity(&[0.8; 4]);
    elements.shortening = SHORTENING;
    (elements, matrix)
}

fn elements() -> (Elements, BlockMatrix) {
    let matrix = BlockMatrix::new(4, PAIRS.map(|(a, b)| (a as u32, b as u32)));
    (Elements::new(&[ELEMENT], &REST, &matrix), matrix)
}

/// The kernel's stiffness of the twelve coordinates [N/m].
fn kernel_stiffness(displacements: &[DVec4]) -> [[f64; 12]; 12] {
    stiffness_of(elements(), displacements)
}

fn stiffness_of(
    (elements, mut matrix): (Elements, BlockMatrix),
    displacements: &[DVec4],
) -> [[f64; 12]; 12] {
    elements.add_stiffness(displacements, LAME, &mut matrix);
    matrix.mirror_upper();
    let entry = |row: usize, column: usize| {
        let place = matrix.place((row / 3) as u32, (column / 3) as u32) as usize;
        f64::from(matrix.blocks()[place][column % 3][row % 3])
    };
    std::array::from_fn(|row| std::array::from_fn(|column| entry(row, column)))
}

/// The stiffness as it is, positive or not [N/m].
fn true_stiffness(displacements: &[DVec4]) -> [[f64; 12]; 12] {
    std::array::from_fn(|row| {
        std::array::from_fn(|column| slope(displacements, row, |at| slope(at, column, energy_j)))
    })
}

fn largest<'a>(values: impl IntoIterator<Item = &'a f64>) -> f64 {
    values.into_iter().fold(0.0, |most, x| most.max(x.abs()))
}

/// Whether the matrix has no eigenvalue below −`share` of its largest entry: by Cholesky's method.
fn is_positive(mut matrix: [[f64; 12]; 12], share: f64) -> bool {
    let lift = share * largest(matrix.iter().flatten());
    for (k, row) in matrix.iter_mut().enumerate() {
        row[k] += lift;
    }
    for pivot in 0..12 {
        if matrix[pivot][pivot] <= 0.0 {
            return false;
        }
        for row in pivot + 1..12 {
            let factor = matrix[row][pivot] / matrix[pivot][pivot];
            for column in pivot..12 {
                matrix[row][column] -= factor * matrix[pivot][column];
            }
        }
    }
    true
}

/// Adds the stiffness of a shear modulus of `share` μ.
fn add_shear(matrix: &mut [[f64; 12]; 12], share: f64) {
    let (gradients, volume_m3) = ELEMENT.shape(&REST);
    for (row, column) in (0..144).map(|k| (k / 12, k % 12)) {
        if row % 3 == column % 3 {
            let product = gradients[row / 3].dot(gradients[column / 3]);
            matrix[row][column] += share * f64::from(LAME.mu_pa) * volume_m3 * product;
        }
    }
}

/// Squashed flat along x, and so firmer along it than across.
const SQUASHED: DMat3 = DMat3::from_diagonal(DVec3::new(0.4, 1.0, 1.0));

#[test]
fn the_check_of_muscle_sees_a_shape_at_rest_that_stays() {
    let at = displaced(near(DMat3::IDENTITY, [0.0; 9]));
    let (forces, _) = forces_of(&muscle().0, &at);
    let still: Vec<f64> = (0..12).map(|k| slope(&at, k, energy_j)).collect();
    let scale = largest(&forces);
    let differs = (0..12).any(|k| (forces[k] + still[k]).abs() > 0.5 * scale);
    assert!(differs && scale > 0.0, "{forces:?} and {still:?}");
}

/// Fails unless forces are the slope of `energy_j`, and the energy is that.
fn hold_forces_to_energy(
    at: &[DVec4],
    (forces, strain): ([f64; 12], Strain),
    energy_j: fn(&[DVec4]) -> f64,
) -> Result<(), TestCaseError> {
    let slopes: Vec<f64> = (0..12).map(|k| slope(at, k, energy_j)).collect();
    // A force of single precision is a sum of parts up to this, each off by 6e-8 a few times.
    let scale = largest(&slopes).max(f64::from(LAME.lambda_pa) * 1e-4);
    for k in 0..12 {
        let error = (forces[k] + slopes[k]).abs() / scale;
        prop_assert!(
            error < 2e-5,
            "coordinate {k}: {} not {}",
            forces[k],
            -slopes[k]
        );
    }
    let energy = energy_j(at);
    let full = f64::from(LAME.lambda_pa) * ELEMENT.shape(&REST).1;
    prop_assert!((strain.energy_j - energy).abs() < 1e-5 * energy.abs().max(full));
    Ok(())
}

proptest! {
    #[test]
    fn forces_are_the_slope_of_the_energy_and_the_energy_is_right(
        noise in prop::array::uniform9(-0.8..0.8),
    ) {
        let at = displaced(near(DMat3::IDENTITY, noise));
        hold_forces_to_energy(&at, kernel_forces(&at), energy_j)?;
    }

    #[test]
    fn stiffness_is_the_slope_of_the_forces_where_that_is_positive(
        dilation in 0.022..0.035,
        noise in prop::array::uniform9(-0.003..0.003),
    ) {
        // Of so dilated a tetrahedron |s| is well below its bound, and nothing is to be changed.
        let at = displaced(near((1.0 + dilation) * DMat3::IDENTITY, noise));
        let (ours, right) = (kernel_stiffness(&at), true_stiffness(&at));
        let scale = largest(right.iter().flatten());
        for (ours, right) in ours.iter().flatten().zip(right.iter().flatten()) {
            // Differences of the second order are good to 1e-6, single precision to 1e-6.
            prop_assert!((ours - right).abs() < 1e-5 * scale, "{ours} not {right}");
        }
    }

    #[test]
    fn forces_of_muscle_are_the_slope_of_the_energy_of_the_shape_that_it_wants(
        noise in prop::array::uniform9(-0.5..0.5),
    ) {
        let at = displaced(near(DMat3::IDENTITY, noise));
        hold_forces_to_energy(&at, forces_of(&muscle().0, &at), pulled_energy_j)?;
    }

    #[test]
    fn stiffness_of_muscle_is_the_slope_of_its_forces_where_that_is_positive(
        dilation in 0.022..0.035,
        noise in prop::array::uniform9(-0.003..0.003),
    ) {
        let at = displaced(near(SCALE * (1.0 + dilation) * DMat3::IDENTITY, noise));
        let ours = stiffness_of(muscle(), &at);
        let right: [[f64; 12]; 12] = std::array::from_fn(|row| {
            std::array::from_fn(|column| {
                slope(&at, row, |at| slope(at, column, pulled_energy_j))
            })
        });
        let scale = largest(right.iter().flatten());
        for (ours, right) in ours.iter().flatten().zip(right.iter().flatten()) {
            // As above.
            prop_assert!((ours - right).abs() < 1e-5 * scale, "{ours} not {right}");
        }
    }

    #[test]
    fn stiffness_is_positive_however_a_tetrahedron_is_bent_out_of_shape(
        noise in prop::array::uniform9(-2.5..2.5),
    ) {
        let mut matrix = kernel_stiffness(&displaced(near(DMat3::IDENTITY, noise)));
        add_shear(&mut matrix, 0.15);
        // Rounding of single precision, of parts that cancel.
        prop_assert!(is_positive(matrix, 1e-6));
    }

    #[test]
    fn both_kinds_of_lanes_give_the_same_bits(noise in prop::array::uniform9(-1.5..1.5)) {
        let at = displaced(near(DMat3::IDENTITY, noise));
        let (elements, matrix) = elements();
        let place = |a, b| matrix.place(a, b);
        let run = [Batch::new(elements.elements(), &REST, place, 4, matrix.unused_place())];
        let moduli = Moduli::from(LAME);
        let (mut plain, mut best) = (vec![Vec4::ZERO; 5], vec![Vec4::ZERO; 5]);
        // SAFETY: five nodes with the unused one, and all blocks.
        let strains = unsafe {
            (
                add_forces_of::<Plain>(&run, &at, moduli, None, plain.as_mut_ptr()),
                add_forces(&run, &at, moduli, None, best.as_mut_ptr()),
            )
        };
        prop_assert_eq!(plain, best);
        prop_assert_eq!(strains.0, strains.1);
        let (mut plain, mut best) = (matrix.clone(), matrix);
        // SAFETY: as above.
        unsafe {
            add_stiffness_of::<Plain>(&run, &at, moduli, None, plain.blocks_mut().as_mut_ptr());
            add_stiffness(&run, &at, moduli, None, best.blocks_mut().as_mut_ptr());
        }
        prop_assert_eq!(plain.blocks(), best.blocks());
    }
}

#[test]
fn checks_of_slope_and_sign_see_what_is_wrong() {
    let at = displaced(SQUASHED);
    let mut lifted = true_stiffness(&at);
    add_shear(&mut lifted, 0.15);
    assert!(!is_positive(lifted, 1e-6));
    assert!(is_positive(kernel_stiffness(&at), 1e-6));
    let (forces, _) = kernel_forces(&at);
    let twice = slope(&at, 0, |at| 2.0 * energy_j(at));
    assert!((forces[0] + twice).abs() > 0.4 * twice.abs());
}

#[test]
fn lost_and_torn_tetrahedra_are_counted() {
    let strain = |f| kernel_forces(&displaced(f)).1;
    let of = |x, y, z| strain(DMat3::from_diagonal(DVec3::new(x, y, z)));
    let counts = |strain: Strain| (strain.lost, strain.torn);
    assert_eq!(counts(of(1.0, 1.0, 1.0)), (0, 0));
    assert_eq!(counts(of(-1.0, 1.0, 1.0)), (1, 0));
    assert_eq!(counts(of(0.04, 1.0, 1.0)), (1, 0));
    assert_eq!(counts(of(9.0, 0.4, 0.4)), (0, 1));
}
