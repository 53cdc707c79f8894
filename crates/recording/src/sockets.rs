//! The sockets in which targets are held.

use nalgebra::{Point3, Vector3};

use super::{
    colours::labelled,
    rerun::{Color, Points3D, Radius},
    solid::single,
};
use body_schema_wire::SocketDescription;

/// The colours of sockets that are learned from, and of held-out ones.
pub(super) const LEARNED: [u8; 3] = [0x2F, 0x8F, 0x7A];
const HELD_OUT: [u8; 3] = [0x9A, 0xA0, 0xA8];
/// Their radius, and the distance below which two share a label, as parts of the arm's reach.
const RADIUS: f64 = 0.014;
const TOGETHER: f64 = 0.3;
/// The most names in a label.
const NAMED: usize = 3;

/// A socket and where it is, or is taken to be.
type At<'a> = (&'a SocketDescription, [f64; 3]);

/// Sockets that are drawn.
pub(super) struct Sockets<'a>(Vec<At<'a>>);

impl<'a> Sockets<'a> {
    /// Those of known position.
    pub(super) fn known(sockets: &'a [SocketDescription]) -> Self {
        Self(sockets.iter().filter_map(|socket| Some((socket, socket.at_m?))).collect())
    }

    /// Those that a learner learned from, where it believes them to be.
    pub(super) fn believed(sockets: &'a [SocketDescription], believed_m: &[[f64; 3]]) -> Self {
        let learned = sockets.iter().filter(|socket| !socket.held_out).zip(believed_m.iter().copied());
        Self(learned.filter(|(_, at)| at.iter().all(|x| x.is_finite())).collect())
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// A point at each.
    pub(super) fn points(&self, reach_m: f64) -> Points3D {
        let colour = |socket: &SocketDescription| Color::from(if socket.held_out { HELD_OUT } else { LEARNED });
        Points3D::new(self.0.iter().map(|(_, at)| single(*at)))
            .with_colors(self.0.iter().map(|(socket, _)| colour(socket)))
            .with_labels(self.0.iter().map(|(socket, _)| socket.label()))
            .with_show_labels(false)
            .with_radii([Radius::new_scene_units((RADIUS * reach_m) as f32)])
    }

    /// Their names as labels of a colour.
    pub(super) fn names(&self, reach_m: f64, colour: [u8; 3]) -> Points3D {
        let groups = groups(&self.0, TOGETHER * reach_m);
        labelled(groups.iter().map(|group| single(middle(group))), colour)
            .with_labels(groups.iter().map(|group| label(group)))
    }
}

/// Sockets that stand together, by the first of each group: labels of neighbours would lie on each other.
fn groups<'a>(sockets: &[At<'a>], together_m: f64) -> Vec<Vec<At<'a>>> {
    let mut groups: Vec<Vec<At<'a>>> = Vec::new();
    for socket in sockets {
        let is_near =
            |group: &&mut Vec<At<'a>>| (Point3::from(group[0].1) - Point3::from(socket.1)).norm() < together_m;
        match groups.iter_mut().find(is_near) {
            Some(group) => group.push(*socket),
            None => groups.push(vec![*socket]),
        }
    }
    groups
}

fn middle(group: &[At<'_>]) -> [f64; 3] {
    (group.iter().map(|(_, at)| Vector3::from(*at)).sum::<Vector3<f64>>() / group.len() as f64).into()
}

/// The names of the sockets of a group, or how many there are, with their place if it is one.
fn label(group: &[At<'_>]) -> String {
    let place = group[0].0.place.as_ref().filter(|place| group.iter().all(|(it, _)| it.place.as_ref() == Some(*place)));
    let names = match (group, place) {
        ([(socket, _)], _) => return socket.label(),
        (group, _) if group.len() > NAMED => format!("{} sockets", group.len()),
        (group, Some(_)) => group.iter().map(|(socket, _)| socket.name.as_str()).collect::<Vec<_>>().join(", "),
        (group, None) => group.iter().map(|(socket, _)| socket.label()).collect::<Vec<_>>().join(", "),
    };
    place.map_or(names.clone(), |place| format!("{place}: {names}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sockets_that_stand_together_share_a_label() {
        let socket = |name: &str| SocketDescription {
            name: name.to_owned(),
            place: Some("shelf".to_owned()),
            at_m: None,
            held_out: false,
        };
        let all = ["a", "b", "c", "d", "e"].map(socket);
        let at = [[0.0; 3], [0.1, 0.0, 0.0], [2.0, 0.0, 0.0], [0.05, 0.0, 0.0], [0.0, 0.1, 0.0]];
        let labels = |count: usize| {
            let sockets: Vec<At<'_>> = all.iter().zip(at).take(count).collect();
            groups(&sockets, 0.3).iter().map(|group| label(group)).collect::<Vec<_>>()
        };
        assert_eq!(labels(3), ["shelf: a, b", "shelf/c"]);
        assert_eq!(labels(5), ["shelf: 4 sockets", "shelf/c"]);
    }
}
