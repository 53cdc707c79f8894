//! The learned joints, base and targets of a fit, with standard deviations.

use nalgebra::{DMatrix, Isometry3, Matrix3, Vector3};

use super::{
    CalibrationError, Case, Coefficient, Correction, Correlation, Fit, Joint, Noise, Placement, Sensed, Target,
};
use body_schema_engine::{
    kinematics::{self, JointKind, chart},
    model::{Block, Place, Quantity, State},
    sensing::Occasion,
};

/// The correlation above which a pair is reported, and the most pairs.
const TOLD: f64 = 0.9;
const MOST: usize = 30;
/// The deviation of a coordinate, as a share of the greatest of its quantity, of which nothing but rounding is left.
const NOTHING: f64 = 1e-6;

/// Something on a link.
struct Placed {
    name: String,
    link: usize,
    /// Its frame at θ = 0, in the base link's.
    frame: Isometry3<f64>,
    is_turned: bool,
    block: Block,
}

impl Case<'_> {
    /// The correction of every joint.
    pub(super) fn joints(&self, fit: &Fit) -> Vec<Joint> {
        let guess = self.guess();
        let state = fit.state().slid_towards(guess);
        (0..state.joints.len()).map(|index| self.joint(index, fit, guess, &state)).collect()
    }

    fn joint(&self, index: usize, fit: &Fit, guess: &State, state: &State) -> Joint {
        let layout = &fit.belief.layout;
        let (described, learned) = (&guess.joints[index], &state.joints[index]);
        let (from, to) = (described.direction(), learned.direction());
        let axis = from.cross(&to);
        let turn = axis.try_normalize(0.0).unwrap_or_default() * from.angle(&to);
        let shift = match (described.line(), learned.line()) {
            (Some(described), Some(learned)) => learned.point - described.point,
            _ => Vector3::zeros(),
        };
        let basis = chart::basis(&to);
        let block = |range: Option<std::ops::Range<usize>>| {
            let (range, covariance) = (range?, fit.belief.covariance.as_ref()?);
            Some(basis * covariance.view((range.start, range.start), (2, 2)) * basis.transpose())
        };
        let across = to.cross_matrix();
        let turned = block(layout.direction(index)).map(|spread| across * spread * across.transpose());
        let kind = learned.kind();
        let unit = if kind == JointKind::Revolute { 1_f64.to_degrees() } else { 1e3 };
        Joint {
            name: self.names.joints[index].clone(),
            kind: match kind {
                JointKind::Revolute => "revolute",
                JointKind::Prismatic => "prismatic",
            }
            .to_owned(),
            learned: layout.is_learned(index),
            shift_mm: (shift * 1e3).into(),
            shift_sd_mm: deviations(block(layout.point(index)).as_ref(), 1e3),
            turn_deg: turn.map(f64::to_degrees).into(),
            turn_sd_deg: deviations(turned.as_ref(), 1_f64.to_degrees()),
            offset: self.number(fit, Block::Offset(index), state.corrections[index].offset, unit),
        }
    }

    fn number(&self, fit: &Fit, block: Block, value: f64, unit: f64) -> Option<Correction> {
        let at = fit.belief.layout.block(block)?.start;
        let sd = fit.belief.covariance.as_ref()?[(at, at)].sqrt();
        Some(Correction { value: value * unit, sd: sd * unit })
    }

    /// The learned focal lengths and centres of cameras, and the learned coefficients of lenses.
    pub(super) fn lenses(&self, fit: &Fit) -> [Vec<Coefficient>; 2] {
        let mut learned = [Vec::new(), Vec::new()];
        let Some(covariance) = &fit.belief.covariance else { return learned };
        for (block, range) in fit.belief.layout.blocks() {
            let (Block::Intrinsics(camera) | Block::Distortion(camera, _)) = block else { continue };
            let Some(device) = fit.state().devices.get(camera) else { continue };
            for (k, at) in range.enumerate() {
                let (list, name, value) = match (block, &device.distortion) {
                    (Block::Distortion(_, index), Some(lens)) => {
                        (1, lens.model().names().get(index), lens.coefficients().get(index))
                    }
                    _ => (0, ["fx", "fy", "cx", "cy"].get(k), device.intrinsics.as_ref().and_then(|it| it.get(k))),
                };
                let (Some(name), Some(value)) = (name, value) else { continue };
                let camera = self.names.cameras.get(camera).cloned().unwrap_or_default();
                let sd = covariance[(at, at)].sqrt();
                learned[list].push(Coefficient { camera, name: (*name).to_owned(), value: *value, sd });
            }
        }
        learned
    }

    /// The pose of the base link in the frame of the measurements.
    pub(super) fn base(&self, fit: &Fit) -> Placement {
        placement(&fit.state().base, self.spread(fit, Block::Base).as_ref())
    }

    /// The places of the targets, in the frames of their links if there is a URDF.
    pub(super) fn targets(&self, fit: &Fit) -> Result<Vec<Target>, CalibrationError> {
        let names = &self.names.targets;
        let of = |(index, target): (usize, &body_schema_engine::model::Target)| Placed {
            name: names.get(index).cloned().unwrap_or_else(|| format!("target {}", index + 1)),
            link: target.link,
            frame: target.place.frame(),
            is_turned: matches!(target.place, Place::Pose(_)),
            block: Block::Target(index),
        };
        self.placed_on_links(fit, fit.state().targets.iter().enumerate().map(of))
    }

    /// The places of the cameras, in the frames of the links that carry them if there is a URDF, or in that of the base.
    pub(super) fn cameras(&self, fit: &Fit) -> Result<Vec<Target>, CalibrationError> {
        let (names, base) = (&self.names.cameras, fit.state().base);
        let of = |(index, device): (usize, &body_schema_engine::model::Device)| {
            let name = names.get(index).cloned().unwrap_or_else(|| format!("camera {}", index + 1));
            let (link, frame) = match device.link {
                Some(link) => (link, device.pose),
                None => (0, base.inverse() * device.pose),
            };
            Placed { name, link, frame, is_turned: true, block: Block::Device(index) }
        };
        self.placed_on_links(fit, fit.state().devices.iter().enumerate().map(of))
    }

    fn placed_on_links(&self, fit: &Fit, all: impl Iterator<Item = Placed>) -> Result<Vec<Target>, CalibrationError> {
        let frames = match &self.described {
            Some(description) => {
                let fitted = description.chain.fitted(&fitted_part(fit.state()));
                // Axes that no URDF can hold leave links where they are described: the report has to say what is wrong.
                Some(fitted.or_else(|_| description.chain.fitted(&fitted_part(self.guess())))?.frames)
            }
            None => None,
        };
        let of = |Placed { name, link, frame, is_turned, block }: Placed| {
            let into = frames.as_ref().map_or_else(Isometry3::identity, |frames| frames[link].inverse());
            let place = placement(&(into * frame), None);
            let spread = self.spread(fit, block);
            Target {
                name,
                link: self.link(link),
                xyz_m: place.xyz_m,
                rpy_rad: is_turned.then_some(place.rpy_rad),
                xyz_sd_m: spread.map(|spread| deviations(Some(&spread.fixed_view::<3, 3>(0, 0).into_owned()), 1.0)),
            }
        };
        Ok(all.map(of).collect())
    }

    /// The name of what moves with the joint of this number, counted from 1; 0 is the base.
    pub fn link(&self, link: usize) -> String {
        match &self.described {
            Some(description) => {
                let chain = &description.chain;
                chain.bodies().get(link).map(|body| chain.link(*body).to_owned()).unwrap_or_default()
            }
            None if link == 0 => "base".to_owned(),
            None => self.names.joints.get(link - 1).cloned().unwrap_or_default(),
        }
    }

    fn spread(&self, fit: &Fit, block: Block) -> Option<DMatrix<f64>> {
        let range = fit.belief.layout.block(block)?;
        let size = range.len();
        Some(fit.belief.covariance.as_ref()?.view((range.start, range.start), (size, size)).into_owned())
    }

    /// Pairs of parameters with correlations above 0.9. A coordinate that the covariance leaves nothing of, since its direction is one that
    /// the rows cannot tell and is held, has none: what is left of it is rounding.
    pub(super) fn correlations(&self, fit: &Fit) -> Vec<Correlation> {
        let Some(covariance) = &fit.belief.covariance else { return Vec::new() };
        let names = self.names.coordinates(&fit.belief.layout, fit.state());
        let quantities = fit.belief.layout.quantities();
        let greatest = |quantity: &Quantity| {
            let alike = quantities.iter().enumerate().filter(|(_, other)| *other == quantity);
            alike.map(|(at, _)| covariance[(at, at)]).fold(0.0, f64::max)
        };
        let is_known: Vec<bool> = (quantities.iter().enumerate())
            .map(|(at, quantity)| covariance[(at, at)] > NOTHING * NOTHING * greatest(quantity))
            .collect();
        let of = |(i, j): (usize, usize)| {
            let correlation = covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt();
            correlation.clamp(-1.0, 1.0)
        };
        let pairs = (0..names.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
        let pairs = pairs.filter(|&(i, j)| is_known[i] && is_known[j]);
        let mut found: Vec<((usize, usize), f64)> =
            pairs.map(|pair| (pair, of(pair))).filter(|it| it.1.abs() > TOLD).collect();
        found.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        let told = |((i, j), correlation): ((usize, usize), f64)| Correlation {
            first: names[i].clone(),
            second: names[j].clone(),
            correlation,
        };
        found.into_iter().take(MOST).map(told).collect()
    }

    /// The noise that the residuals show.
    pub(super) fn noise(&self, fit: &Fit) -> Vec<Noise> {
        let of = |noise: &body_schema_engine::estimation::NoiseFit| {
            let sensor = &self.measurement_model.sensors()[noise.channel];
            let degrees = (noise.equations - noise.absorbed).max(0.0);
            let (sigma, unit) = sensor.nominal(noise.first);
            Noise {
                sensor: self.sensor(Sensed::Channel(noise.channel)),
                unit: unit.to_owned(),
                sigma,
                chi2: noise.squared,
                degrees,
                explaining_sigma: (degrees > 1.0).then(|| (noise.squared / degrees).sqrt() * sigma),
                shared: noise.shared,
            }
        };
        fit.noise.iter().filter(|noise| noise.equations > 0.0).map(of).collect()
    }

    /// The source of a reading, in words.
    pub(super) fn sensor(&self, sensed: Sensed) -> String {
        let (name, number) = match sensed {
            Sensed::Socket(socket) => (self.names.sockets.get(socket), socket),
            Sensed::Channel(channel) => {
                let sensor = &self.measurement_model.sensors()[channel];
                let name = match (sensor.subject().occasion, sensor.subject().point(), self.names.targets.as_slice()) {
                    (Occasion::Held { socket, .. }, ..) => self.names.sockets.get(socket),
                    (_, Some(target), targets) => targets.get(target),
                    (_, None, [target]) => Some(target),
                    _ => None,
                };
                (name, channel)
            }
        };
        name.cloned().unwrap_or_else(|| format!("sensor {}", number + 1))
    }
}

/// A state without what a URDF cannot hold.
pub(super) fn fitted_part(state: &State) -> State {
    let mut state = state.clone();
    for correction in &mut state.corrections {
        *correction = body_schema_engine::model::Correction { offset: correction.offset, ..Default::default() };
    }
    state
}

fn placement(pose: &Isometry3<f64>, spread: Option<&DMatrix<f64>>) -> Placement {
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    let of = |start: usize| {
        let spread = spread.filter(|spread| spread.nrows() >= start + 3)?;
        Some(deviations(Some(&spread.fixed_view::<3, 3>(start, start).into_owned()), 1.0))
    };
    Placement {
        xyz_m: pose.translation.vector.into(),
        rpy_rad: [roll, pitch, yaw],
        xyz_sd_m: of(0),
        rotation_sd_rad: of(3),
    }
}

fn deviations(spread: Option<&Matrix3<f64>>, unit: f64) -> [f64; 3] {
    spread.map_or([0.0; 3], |spread| spread.diagonal().map(|variance| variance.max(0.0).sqrt() * unit).into())
}

/// The direction of an axis, and for a revolute joint the point on it nearest to where the description has it.
pub fn axis(joint: &kinematics::Joint) -> (Vector3<f64>, Option<Vector3<f64>>) {
    (joint.direction().into_inner(), joint.line().map(|line| line.point.coords))
}
