//! The partition of the joint box, cut by the plane of two joints through the chosen configuration.

use egui::{Align2, Color32, FontId, Pos2, Rect, Sense, Shape, Stroke, StrokeKind, Ui, pos2, vec2};

use super::why::joint_value;
use crate::{colours::viridis, panel::Panel, wire::Selection};

/// Room for the values of the joints, at the left and below.
const MARGIN: (f32, f32) = (44.0, 34.0);
const LARGEST: f32 = 300.0;

impl Panel {
    /// Draws the slice; the point that was clicked, in the unit square.
    pub(super) fn slice(
        &self,
        ui: &mut Ui,
        selection: &Selection,
        joints: (usize, usize),
        iteration: usize,
    ) -> Option<[f64; 2]> {
        let side = (ui.available_width() - MARGIN.0 - 8.0).clamp(120.0, LARGEST);
        let (area, response) =
            ui.allocate_exact_size(vec2(side + MARGIN.0 + 8.0, side + MARGIN.1 + 26.0), Sense::click());
        let square = Rect::from_min_size(area.min + vec2(MARGIN.0, 4.0), vec2(side, side));
        let at = |[x, y]: [f64; 2]| pos2(square.left() + x as f32 * side, square.bottom() - y as f32 * side);
        let rectangles = selection.slice(joints, iteration);
        let (low, high) = selection.range();
        let painter = ui.painter().with_clip_rect(area.expand(2.0).intersect(ui.clip_rect()));
        let thin = Stroke::new(0.5, ui.visuals().panel_fill);
        let place = |min: [f64; 2], max: [f64; 2]| Rect::from_two_pos(at(min), at(max));
        for rectangle in &rectangles {
            let rect = place(rectangle.min, rectangle.max);
            // Bright is good: a low criterion.
            let colour = rectangle.value.map_or(Color32::GRAY, |value| viridis(1.0 - (value - low) / (high - low)));
            painter.rect(rect, 0.0, colour, thin, StrokeKind::Inside);
        }
        let bold = Color32::from_rgb(0xD5, 0x5E, 0x00);
        for rectangle in rectangles.iter().filter(|rectangle| rectangle.optimal) {
            let rect = place(rectangle.min, rectangle.max).shrink(1.0);
            painter.rect_stroke(rect, 0.0, Stroke::new(2.0, bold), StrokeKind::Inside);
        }
        let point = |configuration: &[f64]| {
            let unit = |joint: usize| {
                let [low, high] = selection.joints[joint].limits;
                (configuration[joint] - low) / (high - low).max(f64::MIN_POSITIVE)
            };
            at([unit(joints.0), unit(joints.1)])
        };
        cross(&painter, at([selection.chosen.point[joints.0], selection.chosen.point[joints.1]]));
        if let Some(proposed) = self.why.proposed.as_ref().filter(|proposed| proposed.len() == selection.joints.len()) {
            let centre = point(proposed);
            painter.circle(centre, 6.0, Color32::WHITE, Stroke::new(2.5, Color32::BLACK));
        }
        self.slice_axes(ui, &painter, square, selection, joints);
        let inside = |pos: Pos2| {
            let x = f64::from((pos.x - square.left()) / side);
            let y = f64::from((square.bottom() - pos.y) / side);
            ((0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y)).then_some([x, y])
        };
        let hovered = response.hover_pos().and_then(inside);
        let clicked = response.interact_pointer_pos().filter(|_| response.clicked()).and_then(inside);
        if let Some([x, y]) = hovered {
            let under = |r: &&crate::why::Rectangle| x >= r.min[0] && x <= r.max[0] && y >= r.min[1] && y <= r.max[1];
            let value = rectangles.iter().find(under).and_then(|rectangle| rectangle.value);
            let configuration = selection.configuration(joints, [x, y]);
            let words = [joints.0, joints.1].map(|joint| {
                format!(
                    "{} {}",
                    selection.joints[joint].name,
                    joint_value(self, selection, joint, configuration[joint])
                )
            });
            let expected =
                value.map_or(String::new(), |value| format!("\nexpected fall here {:.3}", selection.trace - value));
            response.on_hover_text_at_pointer(format!("{}\n{}{expected}\nClick to propose it", words[0], words[1]));
        }
        clicked
    }

    fn slice_axes(
        &self,
        ui: &Ui,
        painter: &egui::Painter,
        square: Rect,
        selection: &Selection,
        (a, b): (usize, usize),
    ) {
        let (font, colour) = (FontId::proportional(11.0), ui.visuals().text_color());
        let value = |joint: usize, share: f64| {
            let [low, high] = selection.joints[joint].limits;
            joint_value(self, selection, joint, low + share * (high - low))
        };
        for share in [0.0, 0.5, 1.0] {
            let x = square.left() + share as f32 * square.width();
            let align = if share == 0.0 {
                Align2::LEFT_TOP
            } else if share == 1.0 {
                Align2::RIGHT_TOP
            } else {
                Align2::CENTER_TOP
            };
            painter.text(pos2(x, square.bottom() + 2.0), align, value(a, share), font.clone(), colour);
            let y = square.bottom() - share as f32 * square.height();
            let align = if share == 0.0 {
                Align2::RIGHT_BOTTOM
            } else if share == 1.0 {
                Align2::RIGHT_TOP
            } else {
                Align2::RIGHT_CENTER
            };
            painter.text(pos2(square.left() - 4.0, y), align, value(b, share), font.clone(), colour);
        }
        let below = pos2(square.center().x, square.bottom() + 15.0);
        painter.text(below, Align2::CENTER_TOP, &selection.joints[a].name, font.clone(), colour);
        let name = painter.layout_no_wrap(selection.joints[b].name.clone(), font.clone(), colour);
        let start = pos2(square.left() - MARGIN.0, square.center().y + name.size().x / 2.0);
        painter.add(egui::epaint::TextShape::new(start, name, colour).with_angle(-std::f32::consts::FRAC_PI_2));
        let legend = pos2(square.left(), square.bottom() + 32.0);
        let bar = Rect::from_min_size(legend + vec2(0.0, 3.0), vec2(60.0, 9.0));
        let steps = 20;
        for step in 0..steps {
            let strip = Rect::from_min_size(
                bar.min + vec2(bar.width() * step as f32 / steps as f32, 0.0),
                vec2(bar.width() / steps as f32 + 0.5, bar.height()),
            );
            painter.rect_filled(strip, 0.0, viridis(f64::from(step) / f64::from(steps - 1)));
        }
        let text = if square.width() >= LARGEST {
            "teaches little … much   outlined: divided next, ×: chosen"
        } else {
            "little … much   outlined: next"
        };
        painter.text(pos2(bar.right() + 6.0, legend.y), Align2::LEFT_TOP, text, font, colour);
    }
}

/// The chosen point: black on white, to be seen on every colour.
fn cross(painter: &egui::Painter, centre: Pos2) {
    for (width, colour) in [(5.0, Color32::WHITE), (2.5, Color32::BLACK)] {
        for (dx, dy) in [(6.0, 6.0), (6.0, -6.0)] {
            let ends = [centre + vec2(dx, dy), centre - vec2(dx, dy)];
            painter.add(Shape::line_segment(ends, Stroke::new(width, colour)));
        }
    }
}
