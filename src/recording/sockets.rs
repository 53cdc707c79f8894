//! The sockets in which targets are held.

use rerun::{Color, Points3D, Radius};

use crate::experiment::SocketDescription;

/// Of those that are learned from, and of those that are held out.
const LEARNED: [u8; 3] = [0x2F, 0x8F, 0x7A];
const HELD_OUT: [u8; 3] = [0x9A, 0xA0, 0xA8];
/// Their size in a scene, metres.
const RADIUS_M: f32 = 0.012;

/// A point at every socket whose place is known, labelled by its name; `None` where there are none.
pub(super) fn sockets(sockets: &[SocketDescription]) -> Option<Points3D> {
    let known: Vec<_> = sockets.iter().filter_map(|socket| Some((socket, socket.at_m?))).collect();
    let colour = |socket: &SocketDescription| Color::from(if socket.held_out { HELD_OUT } else { LEARNED });
    (!known.is_empty()).then(|| {
        Points3D::new(known.iter().map(|(_, at)| at.map(|x| x as f32)))
            .with_colors(known.iter().map(|(socket, _)| colour(socket)))
            .with_labels(known.iter().map(|(socket, _)| socket.label()))
            .with_show_labels(true)
            .with_radii([Radius::new_scene_units(RADIUS_M)])
    })
}
