//! The loads that can be told from other corrections of readings, and their learned compliance.

use nalgebra::DVector;

use super::{Case, Compliance, Extra, Fit, JointCompliance};
use body_schema_engine::{
    elementary::{cos, sin},
    kinematics::JointKind,
    model::{Block, Load, Loads, State},
};
use body_schema_experiment::Stream;

/// The number of postures within the limits over which corrections are compared, and the seed of their draw.
const POSTURES: usize = 300;
const SEED: u64 = 1;
/// The relative size below which a function cannot be told from zero.
const NOTHING: f64 = 1e-3;

/// The loads with parameters of their own beside other corrections.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Borne {
    pub blocks: Vec<Block>,
    /// The loads without, and why.
    pub said: Vec<String>,
}

/// The values of a correction over the postures, less their mean: an offset has no term of its own.
struct Term {
    name: String,
    values: Vec<DVector<f64>>,
}

impl Case<'_> {
    /// The loads of all revolute joints whose axes are learned, for a robot with the loads of `near`; those that equal other
    /// corrections among `extras` over the joints' limits are left out.
    pub(super) fn borne(&self, extras: &[Extra], near: &State) -> Borne {
        let mut borne = Borne::default();
        let Some(loads) = &near.loads else { return borne };
        let robot = &self.scenario.robot;
        let mut rng = Stream::Workspace.rng(SEED);
        let postures: Vec<Vec<f64>> = (0..POSTURES).map(|_| robot.limits.draw(&mut rng)).collect();
        let torques: Vec<Vec<[f64; 2]>> = postures.iter().map(|posture| loads.torques(posture)).collect();
        let over = |of: &dyn Fn(usize) -> f64| DVector::from_fn(POSTURES, |row, _| of(row));
        let pulls = |joint: usize, load: Load| over(&|row| torques[row][joint][load as usize]);
        let joints: Vec<usize> = (0..loads.joints.len())
            .filter(|joint| robot.layout.is_learned(*joint) && loads.joints[*joint].kind() == JointKind::Revolute)
            .collect();
        let norms = joints.iter().flat_map(|joint| Load::ALL.map(|load| pulls(*joint, load).norm()));
        let greatest = norms.fold(0.0, f64::max);
        for joint in joints {
            let name = &self.names.joints[joint];
            let reading = |of: fn(f64) -> f64| centred(over(&|row| of(postures[row][joint])));
            let mut terms: Vec<Term> = Vec::new();
            if extras.contains(&Extra::Ratios) {
                terms.push(Term { name: "its ratio".to_owned(), values: vec![reading(|q| q)] });
            }
            if extras.contains(&Extra::Eccentricity) {
                let values = vec![reading(sin), reading(cos)];
                terms.push(Term { name: "its eccentricity".to_owned(), values });
            }
            let mut is_pulled = false;
            for load in Load::ALL.into_iter().filter(|load| loads.bears(joint, *load)) {
                let torque = pulls(joint, load);
                if torque.norm() <= NOTHING * greatest {
                    continue;
                }
                is_pulled = true;
                let size = torque.norm();
                let values = centred(torque);
                match alike(&values, size, &terms) {
                    None => borne.blocks.push(Block::Compliance(joint, load)),
                    Some(other) => borne.said.push(format!(
                        "how {name} gives way to the load at the {} cannot be told from {other}: learned as one",
                        load.name()
                    )),
                }
                terms.push(Term {
                    name: format!("how it gives way to the load at the {}", load.name()),
                    values: vec![values],
                });
            }
            if !is_pulled {
                borne.said.push(format!("gravity does not pull at {name}: it has no compliance to learn"));
            }
        }
        borne
    }

    /// The learned compliance of the extended model; `None` where it was not learned.
    pub(super) fn compliance(&self, extended: &Fit) -> Option<Compliance> {
        let loads = extended.state().loads.as_deref()?;
        let covariance = extended.belief.covariance.as_ref();
        let torques: Vec<Vec<[f64; 2]>> =
            extended.rows.iter().map(|row| loads.torques(&self.rows[*row].positions)).collect();
        let term = |(block, range): (Block, std::ops::Range<usize>)| {
            let Block::Compliance(joint, load) = block else { return None };
            let value = extended.state().corrections[joint].compliance[load as usize];
            let pulls = torques.iter().map(|torques| torques[joint][load as usize].abs());
            Some(JointCompliance {
                joint: self.names.joints[joint].clone(),
                load: load.name().to_owned(),
                deg_per_nm: value.to_degrees(),
                sd_deg_per_nm: covariance.map_or(0.0, |p| p[(range.start, range.start)].sqrt().to_degrees()),
                greatest_deg: (value * pulls.fold(0.0, f64::max)).to_degrees(),
            })
        };
        let terms: Vec<JointCompliance> = extended.belief.layout.blocks().filter_map(term).collect();
        let elbow = loads.elbow().and_then(|joint| self.names.joints.get(joint)).cloned().unwrap_or_default();
        (!terms.is_empty()).then(|| Compliance { up: loads.up.into_inner().into(), elbow, terms })
    }

    /// The section `loads:` of readings.yaml.
    pub(super) fn loads_yaml(&self, loads: &Loads) -> String {
        let list = |v: &nalgebra::Vector3<f64>| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
        let mass = |load: Load| {
            let mass = loads.mass(load);
            let link = serde_json::Value::from(self.link(mass.link));
            format!("  {}:\n    link: {link}\n    at_m: {}\n", load.name(), list(&mass.place.coords))
        };
        format!(
            "# The torque about joint i is −gravity ∂h/∂qᵢ, N·m per kg, with h the height along `up` of a place that is fixed to a link of \
             the robot\n# as it was described, before calibration, at the readings q; `up` and `at_m` in the frame of {} with all joints at 0.\nloads:\n  \
             gravity: {:?}\n  up: {}\n{}{}",
            self.link(0),
            body_schema_engine::model::GRAVITY,
            list(&loads.up),
            mass(Load::Target),
            mass(Load::Elbow)
        )
    }
}

/// The names of the terms whose sum is `values`, a function of this size with its mean; `None` if there is no such sum.
fn alike(values: &DVector<f64>, size: f64, terms: &[Term]) -> Option<String> {
    if values.norm() <= NOTHING * size {
        return Some("its offset".to_owned());
    }
    let is_within = |terms: &[&Term]| {
        let mut basis: Vec<DVector<f64>> = Vec::new();
        for column in terms.iter().flat_map(|term| &term.values) {
            let rest = without(column.clone(), &basis);
            if rest.norm() > NOTHING * column.norm() {
                basis.push(rest.normalize());
            }
        }
        without(values.clone(), &basis).norm() <= NOTHING * values.norm()
    };
    if let Some(alone) = terms.iter().find(|term| is_within(&[term])) {
        return Some(alone.name.clone());
    }
    let all: Vec<&Term> = terms.iter().collect();
    let names = || terms.iter().map(|term| term.name.as_str()).collect::<Vec<_>>().join(" and ");
    is_within(&all).then(names)
}

fn centred(values: DVector<f64>) -> DVector<f64> {
    let mean = values.mean();
    values.add_scalar(-mean)
}

/// The part of a vector orthogonal to a basis.
fn without(mut vector: DVector<f64>, basis: &[DVector<f64>]) -> DVector<f64> {
    for unit in basis.iter().chain(basis) {
        let along = unit.dot(&vector);
        vector.axpy(-along, unit, 1.0);
    }
    vector
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums of terms are told, by the name of one term alone where that will do.
    #[test]
    fn sums_of_other_corrections_are_named() {
        let of = |f: fn(f64) -> f64| centred(DVector::from_fn(50, |row, _| f(0.1 * row as f64)));
        let term = |name: &str, values: Vec<DVector<f64>>| Term { name: name.to_owned(), values };
        let terms = [
            term("its ratio", vec![of(|q| q)]),
            term("its eccentricity", vec![of(f64::sin), of(f64::cos)]),
            term("how it gives way to the load at the target", vec![of(|q| q.sin() + (2.0 * q).cos())]),
        ];
        let named = |values: DVector<f64>| alike(&values, 1.0 + values.norm(), &terms);
        assert_eq!(named(of(|q| 3.0 * q - 1.0)).as_deref(), Some("its ratio"));
        assert_eq!(named(of(|q| (q + 0.3).sin())).as_deref(), Some("its eccentricity"));
        assert_eq!(
            named(of(|q| -q.sin() - (2.0 * q).cos())).as_deref(),
            Some("how it gives way to the load at the target")
        );
        let all = "its ratio and its eccentricity and how it gives way to the load at the target";
        assert_eq!(named(of(|q| q + (2.0 * q).cos())).as_deref(), Some(all));
        assert_eq!(named(of(|q| (2.0 * q).sin())), None);
        assert_eq!(named(of(|_| 2.0)).as_deref(), Some("its offset"));
    }
}
