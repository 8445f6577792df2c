//! What can be wrong with a trial, and from where on.

use super::super::sweep::{State, Verdict};
use super::trial::Measures;
use crate::measure::chart::number;
use serde::{Deserialize, Serialize};

/// The kinds of failure, by which failed cells are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    NotFinite,
    Explodes,
    Inverted,
    Tunnelled,
    NotRecovered,
    Unsettled,
    GainsEnergy,
    TooSoft,
    TooStiff,
    Volume,
    Penetrates,
    Drifts,
}

impl Fault {
    /// Every kind, the gravest first.
    pub const ALL: [Self; 12] = [
        Self::NotFinite,
        Self::Explodes,
        Self::Inverted,
        Self::Tunnelled,
        Self::NotRecovered,
        Self::Unsettled,
        Self::GainsEnergy,
        Self::TooSoft,
        Self::TooStiff,
        Self::Volume,
        Self::Penetrates,
        Self::Drifts,
    ];

    /// In a few words.
    pub fn name(self) -> &'static str {
        match self {
            Self::NotFinite => "not finite",
            Self::Explodes => "explodes",
            Self::Inverted => "tetrahedra inverted",
            Self::Tunnelled => "tunnelled",
            Self::NotRecovered => "does not come back",
            Self::Unsettled => "does not settle",
            Self::GainsEnergy => "gains energy",
            Self::TooSoft => "too soft",
            Self::TooStiff => "too stiff",
            Self::Volume => "volume is off",
            Self::Penetrates => "tool gets inside",
            Self::Drifts => "drifts at rest",
        }
    }
}

/// A value up to the first bound is fine, up to the second degraded, beyond failed.
struct Bounds(f64, f64);

/// Farther from rest than this many sizes, a particle was thrown.
const THROWN_SIZES: f64 = 20.0;
/// Speed left after the damping [m/s]: a jitter that is seen from a tenth of a metre a second.
const SPEED_M_S: Bounds = Bounds(1e-3, 0.1);
/// Sag over the static one, and its inverse: an organ twice as soft is another organ.
const SAG: Bounds = Bounds(1.1, 2.0);
/// Energy gained in an undamped release, over the work of gravity down to the static sag.
const ENERGY: Bounds = Bounds(0.05, 1.0);
/// Way of a body on which nothing acts, in sizes: rounding, or a drift that is seen.
const DRIFT: Bounds = Bounds(1e-6, 1e-2);
/// Volume off, as a share.
const VOLUME: Bounds = Bounds(0.05, 0.2);
/// Depth of the tool inside, as a share of the thickness.
const PENETRATION: Bounds = Bounds(0.01, 0.1);
/// RMS distance from the settled state at the end, in sizes, with which a wrecked body is back.
pub const BACK_RMS: f64 = 0.02;

/// What is wrong with a trial, and the kind of its worst fault.
pub fn judge(m: &Measures) -> (Verdict, Option<Fault>) {
    let mut faults: Vec<(State, Fault, String)> = Vec::new();
    let mut fail = |fault, why| faults.push((State::Failed, fault, why));
    if let Some(frame) = m.not_finite_frame {
        fail(Fault::NotFinite, format!("not finite in frame {frame}"));
    }
    if m.farthest_sizes.is_none_or(|sizes| sizes > THROWN_SIZES) {
        let sizes = m.farthest_sizes.map_or("out of sight".to_owned(), |sizes| {
            format!("{} sizes away", number(sizes))
        });
        fail(Fault::Explodes, format!("explodes: a particle {sizes}"));
    }
    let in_truth = m.inverted_tets_oracle.unwrap_or(0);
    if let Some(tets) = m.inverted_tets.filter(|&tets| tets > in_truth) {
        let why = match in_truth {
            0 => format!("{tets} tetrahedra still inverted"),
            some => format!("{tets} tetrahedra still inverted, {some} in truth"),
        };
        fail(Fault::Inverted, why);
    }
    if m.tunnelled == Some(true) {
        fail(Fault::Tunnelled, "tunnelled: the tool is inside".to_owned());
    }
    if let (true, None) = (m.rms_left_sizes.is_some(), m.frames_to_recover) {
        let left = 100.0 * m.rms_left_sizes.unwrap_or(f64::NAN);
        let why = format!("not back in time: {} % of its size off", number(left));
        fail(Fault::NotRecovered, why);
    }
    let mut bound = |value: Option<f64>, Bounds(fine, degraded): Bounds, fault, why: &str| {
        let Some(value) = value.filter(|value| *value > fine) else {
            return;
        };
        let state = if value > degraded {
            State::Failed
        } else {
            State::Degraded
        };
        let why = why.replacen("{}", &number(value), 1);
        faults.push((state, fault, why));
    };
    bound(
        m.speed_left_m_s,
        SPEED_M_S,
        Fault::Unsettled,
        "does not settle: {} m/s left",
    );
    bound(
        m.energy_growth_rel,
        ENERGY,
        Fault::GainsEnergy,
        "gains {} × the work of gravity",
    );
    bound(
        m.sag_ratio,
        SAG,
        Fault::TooSoft,
        "too soft: sags {} × the static solution",
    );
    let stiff = m.sag_ratio.filter(|sag| *sag > 0.0).map(f64::recip);
    bound(
        stiff,
        SAG,
        Fault::TooStiff,
        "too stiff: the static solution sags {} × as far",
    );
    bound(
        m.volume_error_rel,
        VOLUME,
        Fault::Volume,
        "volume off by a share of {}",
    );
    bound(
        m.penetration_share,
        PENETRATION,
        Fault::Penetrates,
        "tool inside by a share of {}",
    );
    bound(
        m.drift_sizes,
        DRIFT,
        Fault::Drifts,
        "drifts at rest by {} sizes",
    );
    let worst = faults
        .iter()
        .max_by_key(|(state, fault, _)| (*state, std::cmp::Reverse(*fault)));
    let worst = worst.map(|(_, fault, _)| *fault);
    let told = faults.into_iter().map(|(state, _, why)| (state, why));
    (Verdict::of(told.collect()), worst)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn calm() -> Measures {
        Measures {
            farthest_sizes: Some(0.5),
            inverted_tets: Some(0),
            speed_left_m_s: Some(0.0),
            sag_ratio: Some(1.0),
            ..Measures::default()
        }
    }

    #[test]
    fn each_kind_of_fault_is_found_alone() {
        assert_eq!(judge(&calm()), (Verdict::of(Vec::new()), None));
        type Spoil = fn(&mut Measures);
        let cases: [(Spoil, Fault, State); 14] = [
            (
                |m| m.not_finite_frame = Some(3),
                Fault::NotFinite,
                State::Failed,
            ),
            (|m| m.farthest_sizes = None, Fault::Explodes, State::Failed),
            (
                |m| m.farthest_sizes = Some(21.0),
                Fault::Explodes,
                State::Failed,
            ),
            (
                |m| m.inverted_tets = Some(12),
                Fault::Inverted,
                State::Failed,
            ),
            (
                |m| m.tunnelled = Some(true),
                Fault::Tunnelled,
                State::Failed,
            ),
            (
                |m| m.rms_left_sizes = Some(0.05),
                Fault::NotRecovered,
                State::Failed,
            ),
            (
                |m| m.speed_left_m_s = Some(0.3),
                Fault::Unsettled,
                State::Failed,
            ),
            (
                |m| m.speed_left_m_s = Some(0.01),
                Fault::Unsettled,
                State::Degraded,
            ),
            (
                |m| m.energy_growth_rel = Some(2.0),
                Fault::GainsEnergy,
                State::Failed,
            ),
            (|m| m.sag_ratio = Some(3.1), Fault::TooSoft, State::Failed),
            (
                |m| m.sag_ratio = Some(0.7),
                Fault::TooStiff,
                State::Degraded,
            ),
            (
                |m| m.volume_error_rel = Some(0.1),
                Fault::Volume,
                State::Degraded,
            ),
            (
                |m| m.penetration_share = Some(0.2),
                Fault::Penetrates,
                State::Failed,
            ),
            (
                |m| m.drift_sizes = Some(1e-4),
                Fault::Drifts,
                State::Degraded,
            ),
        ];
        for (spoil, fault, state) in cases {
            let mut measures = calm();
            spoil(&mut measures);
            let (verdict, worst) = judge(&measures);
            assert_eq!(
                (verdict.state, worst),
                (state, Some(fault)),
                "{}",
                verdict.why
            );
            assert!(!verdict.why.is_empty());
        }
    }

    #[test]
    fn gravest_fault_of_the_worst_state_classifies_a_cell() {
        let mut measures = calm();
        measures.sag_ratio = Some(1.5);
        measures.inverted_tets = Some(2);
        measures.not_finite_frame = Some(7);
        let (verdict, worst) = judge(&measures);
        assert_eq!(worst, Some(Fault::NotFinite));
        assert!(
            verdict
                .why
                .starts_with("not finite in frame 7; 2 tetrahedra"),
            "{}",
            verdict.why
        );
    }

    #[test]
    fn folds_that_the_truth_has_too_are_no_fault() {
        let folded = |inverted_tets, inverted_tets_oracle| Measures {
            inverted_tets,
            inverted_tets_oracle,
            ..calm()
        };
        assert_eq!(judge(&folded(Some(5), Some(5))).1, None);
        assert_eq!(judge(&folded(Some(6), Some(5))).1, Some(Fault::Inverted));
        assert_eq!(judge(&folded(Some(1), None)).1, Some(Fault::Inverted));
    }

    #[test]
    fn body_that_is_back_in_time_has_no_fault() {
        let mut measures = calm();
        measures.rms_left_sizes = Some(0.0);
        measures.frames_to_recover = Some(30);
        assert_eq!(judge(&measures).1, None);
    }
}
