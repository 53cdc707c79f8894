//! The sockets in which targets are held.

use super::{
    rerun::{Color, Points3D, Radius},
    solid::single,
};
use body_schema_wire::SocketDescription;

/// The colours of sockets that are learned from, and of held-out ones.
const LEARNED: [u8; 3] = [0x2F, 0x8F, 0x7A];
const HELD_OUT: [u8; 3] = [0x9A, 0xA0, 0xA8];
/// Their radius, as a part of the arm's reach.
const RADIUS: f64 = 0.014;

/// A point at every socket of known position, labelled by its name; `None` where there are none.
pub(super) fn known(sockets: &[SocketDescription], reach_m: f64) -> Option<Points3D> {
    let known: Vec<_> = sockets.iter().filter_map(|socket| Some((socket, socket.at_m?))).collect();
    (!known.is_empty()).then(|| drawn(&known, reach_m))
}

/// A point at the believed position of every socket that a learner learned from, labelled by its name.
pub(super) fn believed(sockets: &[SocketDescription], believed_m: &[[f64; 3]], reach_m: f64) -> Points3D {
    let learned = sockets.iter().filter(|socket| !socket.held_out).zip(believed_m.iter().copied());
    drawn(&learned.filter(|(_, at)| at.iter().all(|x| x.is_finite())).collect::<Vec<_>>(), reach_m)
}

fn drawn(sockets: &[(&SocketDescription, [f64; 3])], reach_m: f64) -> Points3D {
    let colour = |socket: &SocketDescription| Color::from(if socket.held_out { HELD_OUT } else { LEARNED });
    Points3D::new(sockets.iter().map(|(_, at)| single(*at)))
        .with_colors(sockets.iter().map(|(socket, _)| colour(socket)))
        .with_labels(sockets.iter().map(|(socket, _)| socket.label()))
        .with_show_labels(true)
        .with_radii([Radius::new_scene_units((RADIUS * reach_m) as f32)])
}
