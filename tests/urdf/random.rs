//! Random descriptions, postures and models.

use std::fmt::Write;

use body_schema::{kinematics::Joint, model::State, robot::Chain};
use nalgebra::{UnitQuaternion, UnitVector3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

fn vector(rng: &mut ChaCha8Rng, size: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.random_range(-size..size))
}

fn choice<'a>(rng: &mut ChaCha8Rng, of: &[&'a str]) -> &'a str {
    of[rng.random_range(0..of.len())]
}

/// An origin as somebody may write it; at times near gimbal lock, in part or not at all.
fn origin(rng: &mut ChaCha8Rng) -> String {
    let at = vector(rng, 1.0);
    let mut rpy = vector(rng, 3.2);
    if rng.random_bool(0.3) {
        rpy.y = std::f64::consts::FRAC_PI_2 + [0.0, 1e-13, -1e-9, 1e-6][rng.random_range(0..4)];
    }
    let q = UnitQuaternion::from_euler_angles(rpy.x, rpy.y, rpy.z).into_inner().coords * rng.random_range(0.9..1.1);
    let xyz = format!("xyz = '{} {}\t{}'", at.x, at.y, at.z);
    let turned = format!("rpy=\"{:.4}  {} {}\"", rpy.x, rpy.y, rpy.z);
    let quaternion = format!("quat_xyzw=\"{} {} {} {}\"", q.x, q.y, q.z, q.w);
    match rng.random_range(0..7) {
        0 => String::new(),
        1 => "<origin/>".to_owned(),
        2 => format!("<origin {xyz}></origin>"),
        3 => format!("<origin {turned}/>"),
        4 => format!("<origin {quaternion} {xyz} unknown=\"1\"/>"),
        _ => format!("<origin {turned}  {xyz} />"),
    }
}

/// A tree of links of which `base` to `tip` is a chain with 1 to 9 moving joints.
pub fn description(rng: &mut ChaCha8Rng) -> String {
    let eol = choice(rng, &["\n", "\r\n", " "]);
    let moving = rng.random_range(1..=9);
    let (mut left, mut link, mut text) = (moving, "base".to_owned(), String::new());
    let _ = write!(text, "<?xml version=\"1.0\"?>{eol}<robot name=\"random\">{eol}<link name=\"base\"/>{eol}");
    for index in 0.. {
        let is_fixed = rng.random_bool(0.3);
        let is_last = left == 0 || (left == 1 && !is_fixed && rng.random_bool(0.5));
        let kind = if is_fixed || left == 0 {
            "fixed"
        } else {
            left -= 1;
            choice(rng, &["revolute", "revolute", "continuous", "prismatic"])
        };
        let child = if is_last { "tip".to_owned() } else { format!("link{index}") };
        let axis = vector(rng, 2.0);
        let axis = if rng.random_bool(0.2) { "0 0 -1".to_owned() } else { format!("{} {} {}", axis.x, axis.y, axis.z) };
        let mimic = if index > 0 && rng.random_bool(0.1) { "<mimic joint=\"joint0\" multiplier=\"-2\"/>" } else { "" };
        let mimic = if text.contains("type=\"fixed\" name=\"joint0\"") { "" } else { mimic };
        let parts = [
            "<!-- <origin xyz=\"9 9 9\"/> -->".to_owned(),
            origin(rng),
            format!("<parent link=\"{link}\"/>"),
            format!("<child link=\"{child}\"/>"),
            format!("<axis xyz=\"{axis}\"/>"),
            "<limit lower=\"-1.5\" upper=\"2\" effort=\"1\" velocity=\"1\"/>".to_owned(),
            mimic.to_owned(),
            "<unknown:tag xmlns:unknown=\"x\"><origin xyz=\"8 8 8\"/></unknown:tag>".to_owned(),
        ];
        let _ = write!(text, "  <joint type=\"{kind}\" name=\"joint{index}\" >");
        let rotated = rng.random_range(0..parts.len());
        for part in parts.iter().cycle().skip(rotated).take(parts.len()) {
            let _ = write!(text, "{eol}    {part}");
        }
        let _ = write!(text, "{eol}  </joint>{eol}  <link name=\"{child}\"><visual>");
        let _ = write!(text, "<origin xyz=\"7 7 7\" rpy=\"0 0 1\"/></visual></link>{eol}");
        if is_last {
            break;
        }
        link = child;
    }
    text + "</robot>" + eol
}

/// A posture of the joints that move, within their limits.
pub fn posture(chain: &Chain, rng: &mut ChaCha8Rng) -> Vec<f64> {
    chain.limits().expect("limits").draw(rng)
}

/// The chain's robot with every axis turned by up to `angle` and shifted by up to `length`, along itself too, and, if asked
/// for, offsets of its readings.
pub fn learned(chain: &Chain, angle: f64, length: f64, offsets: bool, rng: &mut ChaCha8Rng) -> State {
    let mut state = chain.state();
    for joint in &mut state.joints {
        let turn = UnitQuaternion::from_scaled_axis(vector(rng, angle / 2.0));
        let turned = |w: &UnitVector3<f64>| UnitVector3::new_normalize(turn * w.into_inner());
        match joint {
            Joint::Revolute(line) => {
                line.direction = turned(&line.direction);
                line.point += vector(rng, length);
                *line = line.slid(rng.random_range(-0.5..0.5));
            }
            Joint::Prismatic(direction) => *direction = turned(direction),
        }
    }
    for correction in state.corrections.iter_mut().filter(|_| offsets) {
        correction.offset = rng.random_range(-angle..angle);
    }
    state
}
