//! Other programs on the same beams, as they were measured; see the head of `peers.csv`.

use serde::Deserialize;

const TABLE: &str = include_str!("peers.csv");

/// One setting of another program.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Peer {
    pub program: String,
    pub version: String,
    /// `f32` or `f64`.
    pub precision: String,
    /// Its energy; `snh` is stable neo-Hookean, ours.
    pub material: String,
    pub substeps: u32,
    pub iterations: u32,
    /// What else was set.
    pub note: String,
    /// As our studies name it.
    pub mesh: String,
    pub youngs_modulus_pa: f64,
    /// Processor time of a frame on one core [ms].
    pub ms: f64,
    /// Against a Newton solve of its own energy; `None` if it exploded or there is no such solve.
    pub tip_error_rel: Option<f64>,
    pub inverted_tets: Option<u32>,
    pub speed_left_m_s: Option<f64>,
    /// First swing [m], its frame, and its error.
    pub swing_m: Option<f64>,
    pub swing_frame: Option<u32>,
    pub swing_error_rel: Option<f64>,
    /// Fifth swing over the first.
    pub fifth_swing_ratio: Option<f64>,
    /// Day it was measured.
    pub taken: String,
}

impl Peer {
    /// Name and setting, as the charts show it.
    pub fn label(&self) -> String {
        let note = if self.note.is_empty() {
            String::new()
        } else {
            format!(", {}", self.note)
        };
        format!(
            "{} {}×{}{note}",
            self.program, self.substeps, self.iterations
        )
    }
}

/// All of them.
pub fn peers() -> Vec<Peer> {
    csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .from_reader(TABLE.as_bytes())
        .deserialize()
        .collect::<Result<_, _>>()
        .expect("the table of peers is sound")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_holds_every_program_with_its_cost() {
        let peers = peers();
        for program in [
            "pypbd XPBD",
            "pbatoolkit XPBD",
            "newton VBD",
            "mujoco",
            "rapier",
            "rapier FEM",
        ] {
            let rows = peers.iter().filter(|peer| peer.program == program);
            assert!(rows.clone().count() >= 2, "{program}");
            assert!(rows.clone().all(|peer| peer.ms > 0.0), "{program}");
        }
    }
}
