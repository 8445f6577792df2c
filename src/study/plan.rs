//! `--set KEY=VALUE` on the plan of a study.

use crate::app::AppError;
use crate::scene::overrides;
use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::Value;

/// `plan` with the values of `sets` in place of its own. A key that holds a list takes a list or a
/// single value, and so narrows the sweep.
///
/// # Errors
///
/// [`AppError::Usage`] naming the setting and, if its key is unknown, the known ones.
pub fn with_sets<P: Serialize + DeserializeOwned>(plan: P, sets: &[String]) -> Result<P, AppError> {
    let mut plan = plan;
    for set in sets {
        let refuse =
            |message: &str| AppError::Usage(format!("--set {set}: {}", message.trim_end()));
        let (path, text) = set
            .split_once('=')
            .ok_or_else(|| refuse("write KEY=VALUE, for example solver.substeps=40"))?;
        let steps: Vec<&str> = path.trim().split('.').collect();
        let mut root = Value::try_from(&plan).expect("a plan is plain data");
        let mut value = overrides::parse(text.trim());
        if held(&root, &steps).is_some_and(Value::is_array) && !value.is_array() {
            value = Value::Array(vec![value]);
        }
        overrides::insert(&mut root, &steps, value).map_err(|message| refuse(&message))?;
        plan = P::deserialize(root).map_err(|error| refuse(error.message()))?;
    }
    Ok(plan)
}

/// What the plan holds at a dotted path.
fn held<'a>(root: &'a Value, steps: &[&str]) -> Option<&'a Value> {
    steps.iter().try_fold(root, |place, step| place.get(*step))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Plan {
        solver: Solver,
    }

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Solver {
        substeps: Vec<u32>,
        youngs_modulus_pa: Vec<f64>,
        poisson_ratio: f64,
    }

    fn set(text: &str) -> Result<Solver, String> {
        let plan = Plan {
            solver: Solver {
                substeps: vec![1, 20],
                youngs_modulus_pa: vec![1e4],
                poisson_ratio: 0.45,
            },
        };
        with_sets(plan, &[text.to_owned()])
            .map(|plan| plan.solver)
            .map_err(|error| error.to_string())
    }

    #[test]
    fn single_value_takes_the_place_of_a_list() {
        assert_eq!(set("solver.substeps=40").unwrap().substeps, [40]);
        assert_eq!(set("solver.substeps=[5, 10]").unwrap().substeps, [5, 10]);
        assert_eq!(
            set("solver.youngs_modulus_pa=5e3")
                .unwrap()
                .youngs_modulus_pa,
            [5e3]
        );
        assert_eq!(set("solver.poisson_ratio=0.3").unwrap().poisson_ratio, 0.3);
    }

    #[test]
    fn unknown_key_and_wrong_type_are_refused_by_name() {
        let unknown = set("solver.substep=40").unwrap_err();
        assert!(
            unknown.contains("substep") && unknown.contains("poisson_ratio"),
            "{unknown}"
        );
        let wrong = set("solver.substeps=many").unwrap_err();
        assert!(
            wrong.contains("solver.substeps=many") && wrong.contains("u32"),
            "{wrong}"
        );
        assert!(set("solver.substeps").unwrap_err().contains("KEY=VALUE"));
    }
}
