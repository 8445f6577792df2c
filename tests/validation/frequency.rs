//! A bar held at one end swings along itself at c/4L.

use super::*;

const LENGTH_M: f64 = 0.1;
const SAMPLES_PER_S: f64 = 240.0;
/// Two seconds' third: five swings.
const SAMPLES: usize = 160;

/// How far the bar is out along its lowest mode, at rest an instant and then let go: once a sample.
fn mode_samples(solver: Solver, setup: &BodySetup, tissue: Tissue) -> Vec<f64> {
    let rest = rest_of(setup);
    let start: Vec<DVec3> = (rest.iter())
        .map(|x| *x + 5e-3 * LENGTH_M * bar_mode(x.x, LENGTH_M) * DVec3::X)
        .collect();
    let amplitude = |x: &[DVec3]| -> f64 {
        (0..rest.len())
            .map(|i| {
                let weight = f64::from(setup.masses_kg[i]) * bar_mode(rest[i].x, LENGTH_M);
                weight * (x[i].x - rest[i].x)
            })
            .sum()
    };
    let mut samples = vec![amplitude(&start)];
    match solver {
        Solver::Reference => {
            let swing = Swing {
                frames: SAMPLES,
                frame_s: 1.0 / SAMPLES_PER_S,
                steps_per_frame: 4,
                damping_per_s: 0.0,
            };
            let start = State {
                velocities: vec![DVec3::ZERO; start.len()],
                positions: start,
            };
            fem(setup, tissue.material())
                .swing(start, &swing, |_, state| {
                    samples.push(amplitude(&state.positions));
                })
                .expect("every step has a solution");
        }
        Solver::Method(method) => {
            // Substeps as long as the default ones.
            let params = SolverParams {
                timestep_s: (1.0 / SAMPLES_PER_S) as f32,
                substeps: 5,
                ..tissue.params(method)
            };
            let mut simulation = simulation(setup, params);
            let start: Vec<Vec3> = start.iter().map(|x| x.as_vec3()).collect();
            simulation.set_state(&start, &vec![Vec3::ZERO; start.len()]);
            for _ in 0..SAMPLES {
                simulation.step(&[]);
                samples.push(amplitude(&positions(&simulation)));
            }
        }
    }
    samples
}

/// Frequency of samples that swing about 0, by the first and the last time that they pass it [Hz].
fn frequency_hz(samples: &[f64]) -> f64 {
    let crossings: Vec<f64> = (samples.windows(2).enumerate())
        .filter(|(_, pair)| pair[0] * pair[1] < 0.0)
        .map(|(i, pair)| i as f64 + pair[0] / (pair[0] - pair[1]))
        .collect();
    let halves = crossings.len().saturating_sub(1);
    assert!(halves >= 8, "{halves} half swings are too few to tell");
    0.5 * halves as f64 * SAMPLES_PER_S / (crossings[halves] - crossings[0])
}

fn frequency_error(solver: Solver, modulus_factor: f64) -> f64 {
    let tissue = Tissue {
        youngs_modulus_pa: 1e4,
        poisson_ratio: solver.smallest_poisson_ratio(),
    };
    let density = f64::from(DENSITY_KG_M3);
    let exact = bar_frequency_hz(tissue.youngs_modulus_pa, density, LENGTH_M);
    let setup = block(Vec3::new(0.1, 0.02, 0.02), [10, 2, 2], |x| x.x < 1e-6);
    let samples = mode_samples(solver, &setup, tissue.stiffer(modulus_factor));
    (frequency_hz(&samples) / exact - 1.0).abs()
}

#[test]
fn bar_swings_along_itself_at_c_over_four_lengths() {
    let solvers = Solver::all(at_best::FREQUENCY, |held| Some(held.frequency));
    assert_all("frequency", &solvers, |solver| frequency_error(solver, 1.0));
}

#[test]
fn frequency_check_notices_a_modulus_five_per_cent_off() {
    let limits = [at_best::FREQUENCY, FAITHFUL.frequency];
    assert_noticed("frequency", limits, |solver| frequency_error(solver, 1.05));
}
