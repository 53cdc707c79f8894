//! A hypothesis on how a table should be read, and its report.

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};

use super::{Diagnostic, DiagnosticKind, Subject, diagnostic::length, fit::Fit};
use body_schema_engine::{elementary::ln, kinematics::JointKind};

/// A way to read the table that may be the right one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Hypothesis {
    /// A joint's readings times a factor: −1 turns the sign round, others change units.
    Scaled(usize, f64),
    /// All angles times a factor.
    Angles(f64),
    /// A joint's readings plus an angle.
    Shifted(usize, f64),
    /// Two joints' columns in each other's place.
    Swapped(usize, usize),
    /// The target's coordinates times a factor: another unit.
    Target(f64),
    /// The target's coordinates times a factor that is no unit.
    Size(f64),
    /// The target's coordinates in a left-handed frame.
    Mirrored,
    /// Poses inverted: the pose of the measurements' frame in the target's.
    Inverted,
    /// Rotations inverted, positions as they are.
    Transposed,
    /// Quaternions with the real part at the other end.
    RealFirst,
    RealLast,
    /// Rotation vectors that are roll, pitch and yaw, or the other way round.
    RollPitchYaw,
    RotationVector,
    /// Measurements paired with the joints of this many rows later; interpolated between rows.
    Lag(f64),
}

/// What a diagnostic says of a table beside its hypothesis.
pub struct Seen<'a> {
    /// The name of the target.
    pub target: &'a str,
    /// Whether it was found in pictures.
    pub is_pictured: bool,
    /// Whether the description is too large for a robot.
    pub is_too_large: bool,
}

/// The factors that are tried of lengths, and what each means: the unit that numbers are in, the one that they are read in, and how their
/// title should end.
pub const LENGTHS: [(f64, [&str; 3]); 5] = [
    (1e-3, ["millimetres", "metres", "_mm"]),
    (1e-2, ["centimetres", "metres", "_cm"]),
    (10.0, ["centimetres", "millimetres", "_cm"]),
    (1e2, ["metres", "centimetres", "_m"]),
    (1e3, ["metres", "millimetres", "_m"]),
];

/// What the nearest factor means.
fn lengths(factor: f64) -> [&'static str; 3] {
    let away = |other: f64| ln(factor / other).abs();
    let nearest = LENGTHS.iter().min_by(|a, b| away(a.0).total_cmp(&away(b.0)));
    nearest.map_or([""; 3], |found| found.1)
}

impl Hypothesis {
    pub fn of_pose(self, pose: &Isometry3<f64>) -> Isometry3<f64> {
        let at = |translation: Vector3<f64>, rotation: UnitQuaternion<f64>| {
            Isometry3::from_parts(translation.into(), rotation)
        };
        let (place, turn) = (pose.translation.vector, pose.rotation);
        let quaternion = |q: [f64; 4]| UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]));
        match self {
            Self::Target(factor) | Self::Size(factor) => at(place * factor, turn),
            Self::Mirrored => at(Vector3::new(place.y, place.x, place.z), turn),
            Self::Inverted => pose.inverse(),
            Self::Transposed => at(place, turn.inverse()),
            // Read as x, y, z, w, written as w, x, y, z; and the other way round.
            Self::RealFirst => at(place, quaternion([turn.i, turn.j, turn.k, turn.w])),
            Self::RealLast => at(place, quaternion([turn.k, turn.w, turn.i, turn.j])),
            Self::RotationVector => {
                let (roll, pitch, yaw) = turn.euler_angles();
                at(place, UnitQuaternion::from_scaled_axis(Vector3::new(roll, pitch, yaw)))
            }
            _ => *pose,
        }
    }

    /// The factor by which it scales coordinates.
    pub fn size(self) -> f64 {
        match self {
            Self::Target(factor) | Self::Size(factor) => factor,
            _ => 1.0,
        }
    }

    /// Whether it may be right although it leaves large residuals, since something else is wrong too. A factor that changes all
    /// readings fits best at some value for any table.
    pub fn may_leave_much(self) -> bool {
        !matches!(self, Self::Size(_) | Self::Lag(_) | Self::RollPitchYaw | Self::RotationVector | Self::Transposed)
    }

    /// The logarithm of the prior probability of such a fault relative to others: where two readings explain the table alike, the
    /// plainer one is reported.
    pub fn log_prior(self, joints: usize) -> f64 {
        let joints = joints as f64;
        match self {
            Self::Angles(_) | Self::Target(_) | Self::Inverted | Self::RealFirst | Self::RealLast => 0.0,
            Self::Scaled(_, factor) if factor < 0.0 => -ln(joints),
            Self::Mirrored | Self::Transposed | Self::RollPitchYaw | Self::RotationVector => -1.0,
            Self::Size(_) => -2.0,
            Self::Scaled(..) => -1.0 - ln(joints),
            Self::Shifted(..) => -2.0 - ln(joints),
            Self::Swapped(..) | Self::Lag(_) => -2.0 - 2.0 * ln(joints),
        }
    }

    pub fn diagnostic(self, subject: &Subject, seen: &Seen<'_>, residual: &Fit, left: &Fit) -> Diagnostic {
        let target = || Some(seen.target.to_owned());
        let column = |joint: usize| subject.columns[joint].clone();
        let turns = |joint: usize| subject.joints[joint].kind() == JointKind::Revolute;
        let small = |factor: f64| factor.abs() < 1.0;
        let (kind, column, what, hint) = match self {
            Self::Scaled(joint, -1.0) => (
                DiagnosticKind::Sign,
                Some(column(joint)),
                "its sign is reversed against the description".to_owned(),
                "turn the sign of the column round, or the joint's <axis>".to_owned(),
            ),
            Self::Scaled(joint, factor) if turns(joint) && small(factor) => (
                DiagnosticKind::Unit,
                Some(column(joint)),
                "degrees, read as radians".to_owned(),
                "end its title with `_deg`".to_owned(),
            ),
            Self::Scaled(joint, _) if turns(joint) => (
                DiagnosticKind::Unit,
                Some(column(joint)),
                "radians, read as degrees".to_owned(),
                "end its title with `_rad`".to_owned(),
            ),
            Self::Scaled(joint, factor) => {
                let [is, read, suffix] = lengths(factor);
                let hint = format!("end its title with `{suffix}`");
                (DiagnosticKind::Unit, Some(column(joint)), format!("{is}, read as {read}"), hint)
            }
            Self::Angles(factor) if small(factor) => (
                DiagnosticKind::Unit,
                None,
                "all joint angles are degrees, read as radians".to_owned(),
                "end their titles with `_deg`".to_owned(),
            ),
            Self::Angles(_) => (
                DiagnosticKind::Unit,
                None,
                "all joint angles are radians, read as degrees".to_owned(),
                "end their titles with `_rad`".to_owned(),
            ),
            Self::Shifted(joint, by) => (
                DiagnosticKind::Zero,
                Some(column(joint)),
                format!("its zero is {:.1} deg from the description's", -by.to_degrees()),
                "correct the column or the joint's <origin>, or learn an offset that wide".to_owned(),
            ),
            Self::Swapped(one, other) => (
                DiagnosticKind::Order,
                Some(column(one)),
                format!("in the place of column `{}`, and that in its", column(other)),
                "exchange the two titles".to_owned(),
            ),
            Self::Target(factor) if seen.is_too_large => (
                DiagnosticKind::Unit,
                None,
                format!("the description is in {}: it should be in metres", lengths(factor.recip())[0]),
                format!("divide the lengths of the URDF by {factor:.0}"),
            ),
            Self::Target(factor) => {
                let [is, read, suffix] = lengths(factor);
                let hint = format!("end their titles with `{suffix}`");
                (DiagnosticKind::Unit, target(), format!("positions are {is}, read as {read}"), hint)
            }
            Self::Size(factor) if seen.is_pictured => (
                DiagnosticKind::Size,
                target(),
                format!("it is seen {:.3} times as large as the robot is described", factor.recip()),
                "measure the tag or board anew, and look over focal_px, whether pixels are of a picture of size_px, and the description's lengths".to_owned(),
            ),
            Self::Size(factor) => (
                DiagnosticKind::Size,
                target(),
                format!("everything is seen {:.3} times as large as it is described", factor.recip()),
                "look over the size of the tag or board that was told to what sees it, the unit, and the description's lengths".to_owned(),
            ),
            Self::Mirrored if seen.is_pictured => (
                DiagnosticKind::Mirror,
                target(),
                "its pictures are mirrored: u and v are exchanged, or v counts from below".to_owned(),
                "u counts to the right, v down: exchange their titles, or write the picture's height less v".to_owned(),
            ),
            Self::Mirrored => (
                DiagnosticKind::Mirror,
                target(),
                "positions are in a left-handed frame".to_owned(),
                "exchange two coordinates' titles, or turn one's sign round".to_owned(),
            ),
            Self::Inverted => (
                DiagnosticKind::Pose,
                target(),
                "poses are inverted: they are those of the sensor as the target sees it".to_owned(),
                "invert them: as for a camera that is given where a board stands before it".to_owned(),
            ),
            Self::Transposed => (
                DiagnosticKind::Pose,
                target(),
                "rotations are inverted, positions are not".to_owned(),
                "transpose the rotations: they take the measurements' frame to the target's".to_owned(),
            ),
            Self::RealFirst => (
                DiagnosticKind::Pose,
                target(),
                "quaternions begin with their real part, which is read as the last".to_owned(),
                "title the columns in the order qw, qx, qy, qz".to_owned(),
            ),
            Self::RealLast => (
                DiagnosticKind::Pose,
                target(),
                "quaternions end with their real part, which is read as the first".to_owned(),
                "title the columns in the order qx, qy, qz, qw".to_owned(),
            ),
            Self::RollPitchYaw => (
                DiagnosticKind::Pose,
                target(),
                "rotations are roll, pitch and yaw, read as rotation vectors".to_owned(),
                "title their columns roll, pitch and yaw".to_owned(),
            ),
            Self::RotationVector => (
                DiagnosticKind::Pose,
                target(),
                "rotations are rotation vectors, read as roll, pitch and yaw".to_owned(),
                "title their columns rx, ry and rz".to_owned(),
            ),
            Self::Lag(rows) => {
                let which = if rows > 0.0 { "below" } else { "above" };
                let count = if rows.fract() == 0.0 { format!("{}", rows.abs()) } else { format!("{:.2}", rows.abs()) };
                (
                    DiagnosticKind::Lag,
                    None,
                    format!(
                        "what was measured belongs to the joints {count} line{} {which}",
                        if rows.abs() == 1.0 { "" } else { "s" }
                    ),
                    "pair joints and measurements by their times anew".to_owned(),
                )
            }
        };
        let evidence = read_so(residual, left);
        Diagnostic { kind, column, lines: Vec::new(), what, evidence, hint }
    }
}

/// The diagnostic about the zeros of several joints.
pub fn zeros_diagnostic(subject: &Subject, shifts: &[(usize, f64)], residual: &Fit, left: &Fit) -> Diagnostic {
    let columns: Vec<&str> = shifts.iter().map(|(joint, _)| subject.columns[*joint].as_str()).collect();
    let angles: Vec<String> = shifts.iter().map(|(_, by)| format!("{:.0}", -by.to_degrees())).collect();
    Diagnostic {
        kind: DiagnosticKind::Zero,
        column: Some(columns.join(", ")),
        lines: Vec::new(),
        what: format!("their zeros are {} deg from the description's", angles.join(", ")),
        evidence: read_so(residual, left),
        hint: "correct the columns or the joints' <origin>, or learn offsets that wide".to_owned(),
    }
}

/// A clause on how much better the description fits.
fn read_so(residual: &Fit, left: &Fit) -> String {
    let turned =
        |fit: &Fit| fit.turned.map(|turned| format!(" and {:.2} deg", turned.to_degrees())).unwrap_or_default();
    format!(
        "read so, the description fits to {}{} instead of {}{} rms",
        length(left.rms),
        turned(left),
        length(residual.rms),
        turned(residual)
    )
}
