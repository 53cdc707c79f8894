//! The report of observability, made from courses of movements.

use nalgebra::{DMatrix, DVector};

use super::{
    Accuracy, Course, Deviation, ErrorPoint, IndexTable, Indices, Needed, Observability, ObservedParameters, Posture,
    Prospect, Weak,
};
use crate::{
    kinematics::{Joint, JointKind},
    model::{Quantity, listed},
    selection::Optimality,
};

/// The share of a weak direction that a block must hold to be named.
const NAMED: f64 = 0.1;

impl Prospect {
    pub(super) fn report(
        &self,
        free: &DMatrix<f64>,
        best: &Course,
        drawn: &[Course],
        floor_m: f64,
        accuracy_m: f64,
    ) -> Observability {
        let (learned, postures) = (self.layout.dimension(), best.movements.len());
        let rank = learned - free.ncols();
        let of = |course: &Course| Indices::of(&self.scaled(&course.information), rank, postures);
        let random: Vec<Indices> = drawn.iter().map(of).collect();
        let median_of = |index: fn(&Indices) -> f64| median(random.iter().map(index).collect());
        let errors: Vec<ErrorPoint> = (0..postures).map(|index| point(index, best, drawn)).collect();
        Observability {
            scenario: self.scenario.clone(),
            title: self.title.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            parameters: ObservedParameters {
                learned,
                rank,
                undetermined: self.names.undetermined(&self.state, &self.layout, free, "any movement"),
            },
            weak: self.weak(best, free.ncols()),
            postures,
            criterion: match self.planning.optimality {
                Optimality::A => "A: the mean squared error of the parameters",
                Optimality::D => "D: the volume of what is not known of the parameters",
                Optimality::E => "E: the error of the parameters that are known worst",
                Optimality::I => "I: the mean squared error of predictions over the joint limits",
            }
            .to_owned(),
            indices: IndexTable {
                best: of(best),
                random_median: Indices {
                    o1: median_of(|it| it.o1),
                    o2: median_of(|it| it.o2),
                    o3: median_of(|it| it.o3),
                    o4: median_of(|it| it.o4),
                    o5: median_of(|it| it.o5),
                },
            },
            deviations: self.deviations_after(best, drawn),
            accuracy: accuracy(&errors, floor_m * 1e3, accuracy_m * 1e3),
            errors,
            best: best
                .movements
                .iter()
                .map(|movement| self.posture(&movement.configuration, movement.socket))
                .collect(),
        }
    }

    fn weak(&self, best: &Course, undetermined: usize) -> Vec<Weak> {
        let told = |(left, direction): (f64, DVector<f64>)| {
            let mut blocks: Vec<(f64, String)> = self
                .layout
                .blocks()
                .map(|(block, range)| (direction.rows_range(range).norm_squared(), self.names.block(block)))
                .filter(|(share, _)| *share > NAMED)
                .collect();
            blocks.sort_by(|a, b| b.0.total_cmp(&a.0));
            let (count, names) = (best.movements.len(), listed(blocks.into_iter().map(|(_, name)| name).collect()));
            let said = format!(
                "little is told of one direction among {names}: {count} chosen postures leave {:.0} % of its deviation",
                100.0 * left
            );
            Weak { left, said }
        };
        self.weakest(&best.information, undetermined).into_iter().map(told).collect()
    }

    fn deviations_after(&self, best: &Course, drawn: &[Course]) -> Vec<Deviation> {
        let names = self.names.coordinates(&self.layout, &self.state);
        let of = |(at, (parameter, quantity)): (usize, (String, &Quantity))| {
            let (unit, factor) = match quantity {
                Quantity::Length => ("mm", 1e3),
                Quantity::Angle => ("deg", 1_f64.to_degrees()),
                Quantity::Pixels => ("px", 1.0),
                Quantity::Ratio => ("1", 1.0),
                Quantity::Compliance => ("deg/(N·m)", 1_f64.to_degrees()),
            };
            let after = |course: &Course| factor * course.covariance[(at, at)].max(0.0).sqrt();
            Deviation {
                parameter,
                unit: unit.to_owned(),
                prior: factor * self.deviations[at],
                best: after(best),
                random_median: median(drawn.iter().map(after).collect()),
            }
        };
        names.into_iter().zip(self.layout.quantities()).enumerate().map(of).collect()
    }

    fn posture(&self, configuration: &[f64], socket: Option<usize>) -> Posture {
        let position = |(joint, position): (&Joint, &f64)| match joint.kind() {
            JointKind::Revolute => position.to_degrees(),
            JointKind::Prismatic => position * 1e3,
        };
        Posture {
            joints: self.state.joints.iter().zip(configuration).map(position).collect(),
            socket: socket.and_then(|socket| self.names.sockets.get(socket).cloned()),
        }
    }
}

fn point(index: usize, best: &Course, drawn: &[Course]) -> ErrorPoint {
    let mut random: Vec<f64> = drawn.iter().map(|course| course.errors_m[index] * 1e3).collect();
    random.sort_by(f64::total_cmp);
    ErrorPoint {
        postures: index + 1,
        best_mm: best.errors_m[index] * 1e3,
        random_median_mm: quantile(&random, 0.5),
        random_q25_mm: quantile(&random, 0.25),
        random_q75_mm: quantile(&random, 0.75),
    }
}

fn accuracy(errors: &[ErrorPoint], floor_mm: f64, wanted_mm: f64) -> Accuracy {
    let needed = |of: fn(&ErrorPoint) -> f64| {
        let errors: Vec<f64> = errors.iter().map(of).collect();
        Needed::of(&errors, floor_mm, wanted_mm)
    };
    let (best, random) = (needed(|it| it.best_mm), needed(|it| it.random_median_mm));
    let number = |needed: Needed| match needed {
        Needed::Within(postures) => postures.to_string(),
        Needed::About(postures) => format!("about {postures}"),
        Needed::Never => "no number of".to_owned(),
    };
    let said = match best {
        Needed::Never => format!(
            "no number of postures reaches {wanted_mm:.2} mm: {floor_mm:.2} mm are left of what no movement tells"
        ),
        _ => format!("{wanted_mm:.2} mm take {} chosen postures, or {} random ones", number(best), number(random)),
    };
    let (best_postures, random_postures) = (best.postures(), random.postures());
    Accuracy { wanted_mm, floor_mm, best_postures, random_postures, said }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    quantile(&values, 0.5)
}

/// A quantile of sorted values, interpolated between neighbours; 0 without values.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let at = share * sorted.len().saturating_sub(1) as f64;
    match (sorted.get(at.floor() as usize), sorted.get(at.ceil() as usize)) {
        (Some(low), Some(high)) => low + (high - low) * at.fract(),
        _ => 0.0,
    }
}
