//! The linear solver against Cholesky's method in f64, and the way downhill.

use super::*;
use crate::{
    geom::{TetMesh, lattice::block_of_cells},
    sim::implicit::Implicit,
};
use glam::{DVec3, Vec3};
use proptest::prelude::*;

const LAME: Lame = Lame {
    mu_pa: 3.4e3,
    lambda_pa: 3.1e4,
};

/// A beam of `cells` of a centimetre, held at one end.
fn beam(cells: [usize; 3]) -> Implicit {
    let size_m = 0.01 * Vec3::from(cells.map(|n| n as f32));
    let (_, lattice) = block_of_cells(size_m, cells);
    let mesh: TetMesh = lattice.tets;
    let inverse_mass = |x: &Vec3| if x.x < 1e-6 { 0.0 } else { 1e3 };
    let places: Vec<Vec4> = (mesh.particles.iter())
        .map(|x| x.extend(inverse_mass(x)))
        .collect();
    let sound: Vec<u32> = (0..mesh.tets.len() as u32).collect();
    Implicit::new(&mesh, &sound, &lattice.fill, &places)
}

/// A goal with inertia for substeps of about `substep_s`, whose free motion is by `way_m` along z.
fn goal(newton: &Newton, substep_s: f64, way_m: f64) -> Goal {
    let count = newton.matrix.len();
    Goal {
        free: vec![DVec4::new(0.0, 0.0, way_m, 0.0); count],
        inertia: vec![1e-3 / substep_s.powi(2); count],
        load_n: (count as f64).sqrt() * 1e-2,
        grip: Grip::default(),
    }
}

/// Displacements up to `size_m`, 0 for what is held.
fn scattered(newton: &Newton, size_m: f64) -> Vec<DVec4> {
    let (count, free) = (newton.trial.len(), newton.matrix.len());
    let place = |i: usize| {
        let phase = i as f64 * DVec3::new(1.7, 2.9, 4.3);
        size_m * DVec3::new(phase.x.sin(), phase.y.sin(), phase.z.sin()).extend(0.0)
    };
    let mut all: Vec<DVec4> = (0..count).map(place).collect();
    all[free..].fill(DVec4::ZERO);
    all
}

/// Solves `matrix` x = `right` in f64 by elimination.
fn dense_solution(matrix: &BlockMatrix, right: &[Vec4]) -> Vec<f64> {
    let count = 3 * matrix.len();
    let mut rows = vec![vec![0.0; count + 1]; count];
    for row in 0..matrix.len() {
        for place in matrix.row(row) {
            let column = matrix.columns()[place] as usize;
            for (i, j) in (0..9).map(|k| (k / 3, k % 3)) {
                rows[3 * row + i][3 * column + j] = f64::from(matrix.blocks()[place][j][i]);
            }
        }
        for i in 0..3 {
            rows[3 * row + i][count] = f64::from(right[row][i]);
        }
    }
    for pivot in 0..count {
        let (head, tail) = rows.split_at_mut(pivot + 1);
        let head = &head[pivot];
        for row in tail {
            let factor = row[pivot] / head[pivot];
            for column in pivot..=count {
                row[column] -= factor * head[column];
            }
        }
    }
    let mut solution = vec![0.0; count];
    for row in (0..count).rev() {
        let known: f64 = (row + 1..count).map(|k| rows[row][k] * solution[k]).sum();
        solution[row] = (rows[row][count] - known) / rows[row][row];
    }
    solution
}

const EXACTLY: Stop = Stop {
    error: 1e-6,
    residual: 0.0,
    iterations_max: 500,
};

#[test]
fn conjugate_gradients_find_what_elimination_finds_with_lattices_and_without() {
    let mut newton = beam([9, 3, 3]).newton;
    let goal = goal(&newton, 0.05, 0.01);
    let at = scattered(&newton, 5e-4);
    newton.evaluate(&at, &goal, LAME);
    newton.assemble(&at, &goal, LAME);
    let right = dense_solution(&newton.matrix, &newton.residual);
    let size = right.iter().map(|x| x * x).sum::<f64>().sqrt();
    for lattices in [false, true] {
        newton.begin_step();
        newton.solve(EXACTLY, lattices);
        let difference = (newton.cg.solution.iter().enumerate())
            .map(|(row, x)| {
                (0..3)
                    .map(|i| (f64::from(x[i]) - right[3 * row + i]).powi(2))
                    .sum::<f64>()
            })
            .sum::<f64>()
            .sqrt();
        // Single precision, 6e-8, times a condition of some hundreds.
        assert!(
            difference < 1e-4 * size,
            "{difference} of {size}, lattices: {lattices}"
        );
    }
}

#[test]
fn lattices_save_most_of_the_iterations_of_a_stiff_body() {
    let mut newton = beam([24, 5, 5]).newton;
    let goal = goal(&newton, 10.0, 0.01);
    let at = scattered(&newton, 0.0);
    newton.evaluate(&at, &goal, LAME);
    newton.assemble(&at, &goal, LAME);
    newton.multigrid.refresh(&newton.matrix);
    newton.multigrid.refresh_lattices(&newton.matrix);
    let stop = Stop {
        error: 1e-3,
        ..EXACTLY
    };
    let mut iterations = |lattices| {
        let Newton {
            matrix,
            multigrid,
            cg,
            residual,
            ..
        } = &mut newton;
        cg.solve(matrix, multigrid, lattices, residual, stop)
    };
    let (without, with) = (iterations(false), iterations(true));
    assert!(
        3 * with < without,
        "{with} with lattices, {without} without"
    );
}

#[test]
fn preconditioner_is_symmetric_and_positive() {
    let mut newton = beam([12, 4, 4]).newton;
    let goal = goal(&newton, 0.05, 0.01);
    let at = scattered(&newton, 1e-3);
    newton.assemble(&at, &goal, LAME);
    newton.multigrid.refresh(&newton.matrix);
    newton.multigrid.refresh_lattices(&newton.matrix);
    let count = newton.matrix.len();
    let vector = |k: f64| -> Vec<Vec4> {
        (0..count)
            .map(|i| {
                let phase = i as f64 * k;
                DVec3::new(phase.sin(), (2.0 * phase).cos(), (3.0 * phase).sin())
                    .as_vec3()
                    .extend(0.0)
            })
            .collect()
    };
    let mut applied = |right: &[Vec4], lattices: bool| {
        let (mut solution, mut product) = (vec![Vec4::ZERO; count], vec![Vec4::ZERO; count]);
        let matrix = &newton.matrix;
        (newton.multigrid).apply(matrix, right, &mut solution, &mut product, lattices);
        for (row, product) in product.iter().enumerate() {
            let right = matrix.product(matrix.row(row), &solution);
            // The product is summed another way, of stiffnesses of 1e3 N/m and more.
            assert!((*product - right).length() < 1e-3, "{product} {right}");
        }
        solution
    };
    let (a, b) = (vector(0.7), vector(1.9));
    for lattices in [false, true] {
        let (inverse_a, inverse_b) = (applied(&a, lattices), applied(&b, lattices));
        let (ab, ba) = (dot(&a, &inverse_b), dot(&b, &inverse_a));
        let size = (dot(&a, &inverse_a) * dot(&b, &inverse_b)).sqrt();
        assert!(dot(&a, &inverse_a) > 0.0 && dot(&b, &inverse_b) > 0.0);
        assert!((ab - ba).abs() < 1e-4 * size, "{ab} {ba} of {size}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn energy_never_rises_whatever_the_start(
        size_m in prop::sample::select(vec![1e-5, 1e-3, 4e-3, 0.02, 0.1]),
        substep_s in prop::sample::select(vec![1e-3, 1.0 / 60.0, 1.0]),
        way_m in -0.02..0.02,
    ) {
        let mut newton = beam([5, 2, 2]).newton;
        let goal = goal(&newton, substep_s, way_m);
        let mut at = scattered(&newton, size_m);
        let mut state = newton.evaluate(&at, &goal, LAME);
        for _ in 0..10 {
            let next = newton.descend(&mut at, state, &goal, LAME, 1);
            // Where the change is below rounding, a step is taken by its slope.
            let rounding = ENERGY_ROUNDING * state.energy_j.abs();
            prop_assert!(next.energy_j <= state.energy_j + rounding);
            // The state that is handed back is that of where it went.
            let there = newton.evaluate(&at, &goal, LAME);
            prop_assert_eq!(there.energy_j, next.energy_j);
            prop_assert_eq!(there.residual_n, next.residual_n);
            state = next;
        }
    }
}

#[test]
fn gentle_start_comes_to_rest_in_a_few_steps() {
    let mut newton = beam([9, 3, 3]).newton;
    let goal = goal(&newton, 1.0 / 60.0, 3e-3);
    let mut at = scattered(&newton, 5e-4);
    let start = newton.evaluate(&at, &goal, LAME);
    let end = newton.descend(&mut at, start, &goal, LAME, 12);
    assert!(
        end.residual_n <= rest_n(&end, &goal),
        "{} N left",
        end.residual_n
    );
}
