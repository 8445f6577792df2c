//! One cell of the study: frames on the GPU, then errors of what they left.

use super::body::{Body, Shape};
use super::estimate::{Blend, Drawn, DrawnPrimitives, Errors, errors_of};
use super::exact::Exact;
use super::sight::{Truth, all_lights};
use super::stage::{FrameTimes, Stage, knobs};
use super::{Cell, Measures};
use crate::app::AppError;
use crate::geom::plane::{LightPathMethod, skip_from_optical_depth_m};
use crate::gpu::{Gpu, GpuError};
use crate::measure::stats::Stats;
use crate::passes::light_path::{RefitCounts, patch_share};
use crate::study::sweep::{Cost, Row, State, Verdict, finite};
use glam::{DVec3, Vec3};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

/// Frames before those that are timed.
const WARM_UP: u32 = 2;
/// GPU time after which no more frames are timed [ms]: a slow fit of a fine mesh takes seconds each.
const ENOUGH_MS: f32 = 4_000.0;
/// How far points wander while frames are timed, as a share of the size.
const WANDER_SHARE: f32 = 0.002;
/// A radiance further off than this is not fine.
const RADIANCE_ERROR_MAX: f64 = 0.2;
/// Goal of every kernel [degrees].
const KERNEL_ERROR_DEG_MAX: f64 = 0.05;

/// The GPU, and what consecutive cells share.
pub struct Bench {
    gpu: Gpu,
    threads: usize,
    body: Kept<Body>,
    exact: Kept<Exact>,
    stage: Mutex<Option<(String, Stage)>>,
    truths: Mutex<Vec<(String, Arc<Truth>)>>,
}

/// The last of a kind, and what it is of.
type Kept<T> = Mutex<Option<(String, Arc<T>)>>;

/// `slot` if it is of `key`, else what `make` makes, kept.
fn kept<T>(
    slot: &Kept<T>,
    key: String,
    make: impl FnOnce() -> Result<T, AppError>,
) -> Result<Arc<T>, AppError> {
    let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, held)) = slot.as_ref().filter(|(there, _)| *there == key) {
        return Ok(held.clone());
    }
    let made = Arc::new(make()?);
    *slot = Some((key, made.clone()));
    Ok(made)
}

/// What the frames of a cell left.
struct Run {
    times: Vec<FrameTimes>,
    counts: RefitCounts,
    drawn: Drawn,
    points: Vec<Vec3>,
}

impl Bench {
    /// A bench on `gpu`, with so many `threads` for the truth.
    pub fn new(gpu: Gpu, threads: usize) -> Self {
        Self {
            gpu,
            threads,
            body: Mutex::default(),
            exact: Mutex::default(),
            stage: Mutex::default(),
            truths: Mutex::default(),
        }
    }

    /// Threads for rays.
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// Measures one cell.
    ///
    /// # Errors
    ///
    /// [`AppError`] if a file can't be read or the GPU fails; a pass that the adapter refuses is a row.
    pub fn measure(&self, cell: &Cell) -> Result<Row<Cell, Measures>, AppError> {
        let body = self.body(cell)?;
        let radius_m = (cell.radius_share * cell.size_m) as f32;
        let patch_m = patch_share(cell.method) * radius_m;
        let exact_key = format!("{}|{patch_m}|{}", body_key(cell), cell.origin_m);
        let origin_m = Vec3::X * cell.origin_m as f32;
        let exact = kept(&self.exact, exact_key, || {
            Ok(Exact::new(&body, patch_m, origin_m))
        })?;
        let pose = cell.deformation.apply(&body);
        let run = match self.run(cell, &body, &pose, radius_m) {
            Ok(run) => run,
            Err(error @ (GpuError::BufferTooLarge { .. } | GpuError::DispatchTooLarge { .. })) => {
                return Ok(refused(cell, &body, &exact, &error));
            }
            Err(error) => return Err(AppError::Gpu(error)),
        };
        let fits = exact.errors(cell.method, &run.drawn, &run.points, self.threads);
        let (mut errors, mut published) = (Errors::default(), None);
        let mut unturned = Errors::default();
        if cell.sights > 0 {
            let truth = self.truth(cell, &body, &pose, f64::from(radius_m));
            errors = errors_of(&truth, &run.drawn, Blend::Squared);
            if cell.method == LightPathMethod::Stale {
                let along = run.drawn.moved_along(&body.mesh.points, &run.points);
                unturned = errors_of(&truth, &along, Blend::Squared);
            }
            if matches!(run.drawn.primitives, DrawnPrimitives::Planes(_)) {
                published = errors_of(&truth, &run.drawn, Blend::Published).radiance;
            }
        }
        let stats = |time: fn(&FrameTimes) -> Option<f32>| {
            Stats::of(run.times.iter().filter_map(time)).map(|stats| (stats.p50, stats.p95))
        };
        let (refit, all) = (stats(|times| times.refit), stats(|times| times.all));
        let measures = Measures {
            vertices: body.mesh.points.len() as u32,
            patch_members: exact.members_mean,
            moved: run.counts.moved,
            refitted: run.counts.refitted,
            refit_ms_p50: refit.map(|(p50, _)| p50),
            refit_ms_p95: refit.map(|(_, p95)| p95),
            normal_error_deg_p99: fits.normal_deg_p99.and_then(finite),
            // What is passed over on purpose is no error of the kernel.
            kernel_error_deg_p999: (cell.skip_optical_depth == 0.0)
                .then_some(fits.kernel_deg_p999)
                .flatten()
                .and_then(finite),
            km_error_rel: errors.km.and_then(finite),
            radiance_error_rel: errors.radiance.and_then(finite),
            radiance_error_front_rel: errors.front.and_then(finite),
            radiance_error_graze_rel: errors.graze.and_then(finite),
            radiance_error_back_rel: errors.back.and_then(finite),
            radiance_error_poked_rel: errors.poked.and_then(finite),
            radiance_error_with_shadows_rel: errors.shadowed.and_then(finite),
            radiance_error_published_rel: published.and_then(finite),
            radiance_error_unturned_rel: unturned.radiance.and_then(finite),
            radiance_error_unturned_poked_rel: unturned.poked.and_then(finite),
            oracle: "f64 rays at the deformed triangles; f64 fits".to_owned(),
        };
        Ok(Row {
            verdict: verdict(&measures, run.drawn.is_finite()),
            cell: cell.clone(),
            measures,
            cost: Cost {
                ms_p50: all.map(|(p50, _)| p50),
                ms_p95: all.map(|(_, p95)| p95),
            },
        })
    }

    fn body(&self, cell: &Cell) -> Result<Arc<Body>, AppError> {
        kept(&self.body, body_key(cell), || {
            match (Shape::named(&cell.body), cell.vertices_asked) {
                (Some(shape), Some(asked)) => Ok(Body::of_shape(shape, asked, cell.size_m as f32)),
                _ => Body::of_file(Path::new(&cell.body), cell.size_m as f32),
            }
        })
    }

    /// The truth of a pose, which all methods share.
    fn truth(&self, cell: &Cell, body: &Body, pose: &[DVec3], radius_m: f64) -> Arc<Truth> {
        let of_body = format!("{}|{}|{}", body_key(cell), cell.radius_share, cell.sights);
        let key = format!("{of_body}|{}", cell.deformation.name());
        let mut truths = self.truths.lock().unwrap_or_else(PoisonError::into_inner);
        // Those of other bodies and radii are not asked for again.
        truths.retain(|(there, _)| there.starts_with(&of_body));
        if let Some((_, truth)) = truths.iter().find(|(there, _)| *there == key) {
            return truth.clone();
        }
        let sights = cell.sights as usize;
        let truth = Arc::new(Truth::new(body, pose, radius_m, sights, self.threads));
        truths.push((key, truth.clone()));
        truth
    }

    fn run(
        &self,
        cell: &Cell,
        body: &Body,
        pose: &[DVec3],
        radius_m: f32,
    ) -> Result<Run, GpuError> {
        let origin = Vec3::X * cell.origin_m as f32;
        let key = format!(
            "{}|{}|{}|{}|{}",
            body_key(cell),
            cell.radius_share,
            cell.method.name(),
            cell.skip_optical_depth,
            cell.origin_m
        );
        // The tissue of the truth keeps a hundredth over the radius.
        let extinction_per_m = -0.01_f32.ln() / radius_m;
        let skip = cell.skip_optical_depth as f32;
        let skip_m = skip_from_optical_depth_m(skip, extinction_per_m);
        let knobs_of_cell = knobs(cell.method, radius_m, skip_m);
        let mut slot = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        let held = slot.take().filter(|(there, _)| *there == key);
        let mut stage = match held {
            Some((_, stage)) => stage,
            None => Stage::new(&self.gpu, body, knobs_of_cell, origin)?,
        };
        let moving = moving(body, cell.moved_share);
        let rest: Vec<Vec3> = pose.iter().map(|p| p.as_vec3() + origin).collect();
        let mut points = rest.clone();
        let mut times = Vec::new();
        let mut counts = RefitCounts::default();
        let mut spent_ms = 0.0;
        let is_long = cell.sights == 0;
        for frame in 0..WARM_UP + cell.frames {
            // Incommensurate with the frame: no pose comes twice.
            let away = WANDER_SHARE * body.size_m * (1.3 * frame as f32).sin();
            for &point in &moving {
                let p = rest[point];
                let wave = 1.0 + 0.5 * (40.0 * body.mesh.points[point].y / body.size_m).sin();
                points[point] = p + away * wave * Vec3::new(0.6, 0.64, 0.48);
            }
            if is_long && frame % 100 != 0 {
                stage.untimed_frame(&points);
                continue;
            }
            let time = stage.frame(&points)?;
            if frame >= WARM_UP {
                spent_ms += time.all.unwrap_or(0.0);
                times.push(time);
                counts = stage.counts()?;
            }
            if spent_ms > ENOUGH_MS && times.len() > 2 && !is_long {
                break;
            }
        }
        // The pose itself, at which the errors are taken.
        stage.untimed_frame(&rest);
        let drawn = stage.drawn(&rest, &all_lights(body))?;
        *slot = Some((key, stage));
        Ok(Run {
            times,
            counts,
            drawn,
            points: rest,
        })
    }

    /// What `method` leaves of `body` at rest moved to `points` in one frame.
    ///
    /// # Errors
    ///
    /// [`AppError::Gpu`] if the adapter refuses it.
    pub fn drawn(
        &self,
        body: &Body,
        method: LightPathMethod,
        radius_m: f32,
        points: &[Vec3],
        lights: &[[DVec3; 3]],
    ) -> Result<Drawn, AppError> {
        let mut stage = self.stage(body, method, radius_m)?;
        stage.untimed_frame(points);
        Ok(stage.drawn(points, lights)?)
    }

    /// The passes of `method` for `body` at rest.
    ///
    /// # Errors
    ///
    /// [`AppError::Gpu`] if the adapter refuses it.
    pub fn stage(
        &self,
        body: &Body,
        method: LightPathMethod,
        radius_m: f32,
    ) -> Result<Stage, AppError> {
        let knobs = knobs(method, radius_m, 0.0);
        Ok(Stage::new(&self.gpu, body, knobs, Vec3::ZERO)?)
    }
}

fn body_key(cell: &Cell) -> String {
    format!("{}|{:?}|{}", cell.body, cell.vertices_asked, cell.size_m)
}

/// The points nearest to the poked one at rest, by their share of all.
fn moving(body: &Body, share: f64) -> Vec<usize> {
    let points = &body.mesh.points;
    let at = points[body.poked];
    let mut moving: Vec<usize> = (0..points.len()).collect();
    moving.sort_by(|&a, &b| {
        let distance = |point: usize| points[point].distance_squared(at);
        distance(a).total_cmp(&distance(b))
    });
    moving.truncate((share * points.len() as f64).round() as usize);
    moving
}

fn verdict(measures: &Measures, is_finite: bool) -> Verdict {
    let mut faults = Vec::new();
    if !is_finite {
        faults.push((State::Failed, "a primitive is not finite".to_owned()));
    }
    if let Some(error) = measures
        .radiance_error_rel
        .filter(|e| *e > RADIANCE_ERROR_MAX)
    {
        let percent = 100.0 * error;
        faults.push((State::Degraded, format!("radiance is {percent:.0} % off")));
    }
    if let Some(angle) = (measures.kernel_error_deg_p999).filter(|a| *a > KERNEL_ERROR_DEG_MAX) {
        let problem = format!("fits are {angle:.2} degrees from f64 at the 99.9th percentile");
        faults.push((State::Degraded, problem));
    }
    Verdict::of(faults)
}

/// The row of a method whose pass this adapter can't have.
fn refused(cell: &Cell, body: &Body, exact: &Exact, error: &GpuError) -> Row<Cell, Measures> {
    Row {
        cell: cell.clone(),
        measures: Measures {
            vertices: body.mesh.points.len() as u32,
            patch_members: exact.members_mean,
            moved: 0,
            refitted: 0,
            refit_ms_p50: None,
            refit_ms_p95: None,
            normal_error_deg_p99: None,
            kernel_error_deg_p999: None,
            km_error_rel: None,
            radiance_error_rel: None,
            radiance_error_front_rel: None,
            radiance_error_graze_rel: None,
            radiance_error_back_rel: None,
            radiance_error_poked_rel: None,
            radiance_error_with_shadows_rel: None,
            radiance_error_published_rel: None,
            radiance_error_unturned_rel: None,
            radiance_error_unturned_poked_rel: None,
            oracle: "none".to_owned(),
        },
        cost: Cost::default(),
        verdict: Verdict::of(vec![(State::Failed, error.to_string())]),
    }
}

#[cfg(test)]
mod tests {
    use super::super::deform::Deformation;
    use super::*;

    fn cell(method: LightPathMethod, deformation: Deformation) -> Cell {
        Cell {
            method,
            body: "blob".to_owned(),
            size_m: 0.15,
            vertices_asked: Some(600),
            deformation,
            radius_share: 0.1,
            skip_optical_depth: 0.0,
            moved_share: 1.0,
            frames: 1,
            origin_m: 0.0,
            sights: 60,
        }
    }

    #[test]
    fn stale_planes_err_more_than_refitted_ones_where_the_body_is_twisted_and_as_much_at_rest() {
        let bench = Bench::new(Gpu::headless().expect("an adapter"), 2);
        let error = |method, deformation| {
            let row = bench
                .measure(&cell(method, deformation))
                .expect("it is measured");
            row.measures.radiance_error_rel.expect("there are sights")
        };
        let [stale, full] = [LightPathMethod::Stale, LightPathMethod::Full];
        let twist = Deformation::Twist;
        let (of_stale, of_full) = (error(stale, twist), error(full, twist));
        assert!(of_stale > 1.5 * of_full, "{of_stale} and {of_full}");
        let row = bench.measure(&cell(stale, twist)).expect("it is measured");
        let unturned = row.measures.radiance_error_unturned_rel;
        let unturned = unturned.expect("it is stale");
        assert!(
            (1.1 * of_full..of_stale).contains(&unturned),
            "{unturned} between {of_full} and {of_stale}"
        );
        let rest = error(full, Deformation::Rest);
        assert!((error(stale, Deformation::Rest) / rest - 1.0).abs() < 1e-3);
    }

    #[test]
    fn a_row_says_how_much_moved_and_what_was_fitted_from_f64() {
        let bench = Bench::new(Gpu::headless().expect("an adapter"), 2);
        let mut poke = cell(LightPathMethod::Incremental, Deformation::Poke);
        poke.moved_share = 0.05;
        poke.frames = 3;
        let row = bench.measure(&poke).expect("it is measured");
        let measures = row.measures;
        assert_eq!(measures.vertices, 642);
        assert_eq!(measures.moved, 32, "a twentieth of 642");
        assert!(measures.refitted > 32 && measures.refitted < 642);
        assert!(measures.kernel_error_deg_p999.expect("it is fitted") < 0.05);
        assert!(measures.radiance_error_published_rel.is_some());
        poke.moved_share = 0.0;
        let still = bench.measure(&poke).expect("it is measured").measures;
        assert_eq!((still.moved, still.refitted), (0, 0));
    }

    #[test]
    fn verdict_names_what_is_not_finite_and_what_is_far_off() {
        let bench = Bench::new(Gpu::headless().expect("an adapter"), 2);
        let still = cell(LightPathMethod::Tangent, Deformation::Rest);
        let mut measures = bench.measure(&still).expect("it is measured").measures;
        assert_eq!(verdict(&measures, false).state, State::Failed);
        measures.radiance_error_rel = Some(0.31);
        let told = verdict(&measures, true);
        assert_eq!(told.state, State::Degraded);
        assert!(told.why.contains("31 %"), "{}", told.why);
    }
}
