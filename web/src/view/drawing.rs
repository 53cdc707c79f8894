//! The small pictures of the groups of scenarios.

use egui::{Color32, Painter, Pos2, Rect, Sense, Shape, Stroke, StrokeKind, Ui, vec2};

use super::style::accent;

/// Width and height.
const SIZE: egui::Vec2 = vec2(46.0, 34.0);
/// The marker on a hand, as the scene draws it.
const MARKER: Color32 = Color32::from_rgb(0xE6, 0xB4, 0x22);

/// What a picture shows.
#[derive(Clone, Copy, Debug)]
pub(super) enum Drawing {
    /// An arm with a marker on its hand.
    Arm,
    /// A head, and what it sees.
    Head,
    /// An arm, and where its forearm is now.
    Break,
    /// A camera and a tag.
    Camera,
    /// A ball in a socket.
    Socket,
    /// An arm as one buys it.
    Real,
}

impl Drawing {
    /// Draws it. It says nothing that the words beside it do not.
    pub(super) fn show(self, ui: &mut Ui) {
        let (rect, _) = ui.allocate_exact_size(SIZE, Sense::hover());
        let pen = Pen {
            painter: ui.painter(),
            corner: rect.min,
            line: ui.visuals().text_color(),
            accent: accent(ui.visuals().dark_mode),
        };
        match self {
            Self::Arm => {
                pen.limbs(&[(6.0, 30.0), (14.0, 12.0), (28.0, 18.0), (38.0, 6.0)], pen.line);
                pen.dot((38.0, 6.0), 3.5, MARKER);
            }
            Self::Head => {
                let sight = [(12.0, 14.0), (42.0, 2.0), (42.0, 26.0)];
                let sight = sight.map(|at| pen.at(at)).to_vec();
                pen.painter.add(Shape::convex_polygon(sight, pen.accent.gamma_multiply(0.3), Stroke::NONE));
                pen.ring((9.0, 14.0), 7.0);
                pen.dot((12.0, 12.5), 1.5, pen.line);
                pen.stroke(&[(9.0, 21.0), (9.0, 32.0)], 3.0, pen.line);
                pen.dot((34.0, 14.0), 3.5, MARKER);
            }
            Self::Break => {
                pen.limbs(&[(6.0, 30.0), (16.0, 10.0)], pen.line);
                pen.stroke(&[(16.0, 10.0), (40.0, 12.0)], 2.0, pen.line.gamma_multiply(0.4));
                pen.limbs(&[(16.0, 10.0), (38.0, 26.0)], pen.accent);
            }
            Self::Camera => {
                pen.frame((3.0, 9.0), (19.0, 22.0));
                pen.frame((19.0, 12.0), (23.0, 19.0));
                pen.frame((32.0, 8.0), (44.0, 24.0));
                for at in [(35.0, 12.0), (41.0, 16.0), (35.0, 20.0)] {
                    pen.dot(at, 1.8, pen.line);
                }
            }
            Self::Socket => {
                pen.stroke(&[(12.0, 16.0), (14.0, 25.0), (23.0, 29.0), (32.0, 25.0), (34.0, 16.0)], 3.0, pen.line);
                pen.dot((23.0, 17.0), 8.0, MARKER);
                pen.stroke(&[(23.0, 9.0), (23.0, 2.0)], 3.0, pen.line);
            }
            Self::Real => {
                pen.stroke(&[(4.0, 31.0), (20.0, 31.0)], 4.0, pen.line);
                pen.stroke(&[(12.0, 31.0), (12.0, 12.0), (30.0, 8.0), (36.0, 18.0)], 5.0, pen.line);
                pen.stroke(&[(33.0, 24.0), (33.0, 19.0), (40.0, 18.0), (41.0, 23.0)], 2.0, pen.line);
                for joint in [(12.0, 12.0), (30.0, 8.0)] {
                    pen.dot(joint, 2.0, pen.accent);
                }
            }
        }
    }
}

/// Draws by distances from the picture's upper left corner.
struct Pen<'a> {
    painter: &'a Painter,
    corner: Pos2,
    line: Color32,
    accent: Color32,
}

impl Pen<'_> {
    fn at(&self, (x, y): (f32, f32)) -> Pos2 {
        self.corner + vec2(x, y)
    }

    fn stroke(&self, points: &[(f32, f32)], width: f32, colour: Color32) {
        let points = points.iter().map(|point| self.at(*point)).collect();
        self.painter.add(Shape::line(points, Stroke::new(width, colour)));
    }

    /// Links with a joint at each of their ends but the last.
    fn limbs(&self, points: &[(f32, f32)], colour: Color32) {
        self.stroke(points, 3.0, colour);
        points[..points.len() - 1].iter().for_each(|joint| self.dot(*joint, 3.0, colour));
    }

    fn dot(&self, at: (f32, f32), radius: f32, colour: Color32) {
        self.painter.circle_filled(self.at(at), radius, colour);
    }

    fn ring(&self, at: (f32, f32), radius: f32) {
        self.painter.circle_stroke(self.at(at), radius, Stroke::new(2.0, self.line));
    }

    fn frame(&self, from: (f32, f32), to: (f32, f32)) {
        let rect = Rect::from_min_max(self.at(from), self.at(to));
        self.painter.rect_stroke(rect, 1.0, Stroke::new(2.0, self.line), StrokeKind::Inside);
    }
}
