//! The partition of the joint box, cut by the plane of two joints through the chosen configuration.

use body_schema_engine::optimize::{Plane, Projection};
use body_schema_wire::Choice;
use egui::{
    Align2, Color32, FontId, Pos2, Rect, RichText, Sense, Shape, Stroke, StrokeKind, Ui, WidgetInfo, accesskit::Role,
    pos2, vec2,
};

use super::{style::accent, why::joint_value};
use crate::{
    colours::viridis,
    panel::Panel,
    search::{Cell, Search},
};

/// Room for the values of the joints, at the left and below.
const MARGIN: (f32, f32) = (48.0, 38.0);
/// How far values stand off: the cross often marks a corner.
const OFF: f32 = 8.0;
const LARGEST: f32 = 300.0;

impl Panel {
    /// Draws the slice; the point that was clicked, in the unit square.
    pub(super) fn slice(&self, ui: &mut Ui, search: &Search, plane: Plane, iteration: usize) -> Option<[f64; 2]> {
        let side = (ui.available_width() - MARGIN.0 - 8.0).clamp(120.0, LARGEST);
        let (area, response) = ui.allocate_exact_size(vec2(side + MARGIN.0 + 8.0, side + MARGIN.1), Sense::click());
        let square = Rect::from_min_size(area.min + vec2(MARGIN.0, 4.0), vec2(side, side));
        let at = |[x, y]: [f64; 2]| pos2(square.left() + x as f32 * side, square.bottom() - y as f32 * side);
        let cells = search.slice(plane, iteration);
        let (low, high) = search.range();
        let painter = ui.painter().with_clip_rect(area.expand(2.0).intersect(ui.clip_rect()));
        let thin = Stroke::new(0.5, ui.visuals().panel_fill);
        let rect = |cell: &Cell| {
            let Projection { centre: [x, y], half: [half_x, half_y] } = cell.place;
            Rect::from_two_pos(at([x - half_x, y - half_y]), at([x + half_x, y + half_y]))
        };
        for cell in &cells {
            // Bright is good: a low criterion.
            let colour = cell.value.map_or(Color32::GRAY, |value| viridis(1.0 - (value - low) / (high - low)));
            painter.rect(rect(cell), 0.0, colour, thin, StrokeKind::Inside);
        }
        let bold = accent(ui.visuals().dark_mode);
        for cell in cells.iter().filter(|cell| cell.optimal) {
            painter.rect_stroke(rect(cell).shrink(1.0), 0.0, Stroke::new(2.0, bold), StrokeKind::Inside);
        }
        cross(&painter, at(search.chosen(plane)));
        let joints = search.choice().joints.len();
        if let Some(proposed) = self.why.proposed.as_ref().filter(|proposed| proposed.len() == joints) {
            let centre = at(search.place(plane, proposed));
            yours(&painter, centre);
            self.answer_at(&painter, centre, square, search.choice());
        }
        self.slice_axes(ui, &painter, square, search, plane);
        let inside = |pos: Pos2| {
            let x = f64::from((pos.x - square.left()) / side);
            let y = f64::from((square.bottom() - pos.y) / side);
            ((0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y)).then_some([x, y])
        };
        let name = "Slice of the search: click a point to ask what it would have taught";
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, name));
        legend(ui);
        let hovered = response.hover_pos().and_then(inside);
        let clicked = response.interact_pointer_pos().filter(|_| response.clicked()).and_then(inside);
        if let (Some(place), Some(pointer)) = (hovered, response.hover_pos()) {
            let under = cells.iter().find(|cell| rect(cell).contains(pointer));
            let text = self.slice_hint(search, plane, place, under.and_then(|cell| cell.value));
            response.on_hover_text_at_pointer(text);
        }
        clicked
    }

    /// What stands at the pointer: the joints there and what the search says of the rectangle under it.
    fn slice_hint(&self, search: &Search, plane: Plane, place: [f64; 2], value: Option<f64>) -> String {
        let configuration = search.configuration(plane, place);
        let mut text = String::new();
        for joint in plane.axes() {
            let name = &search.choice().joints[joint].name;
            text += &format!("{name} {}\n", joint_value(self, joint, configuration[joint]));
        }
        if let (Some(trace), Some(value)) = (search.choice().trace, value) {
            text += &format!("the middle of its box teaches {:.3}\n", trace - value);
        }
        text + if self.touch { "Tap to ask about this posture" } else { "Click to ask about this posture" }
    }

    /// What the visitor's posture would have taught, beside the point that stands for it.
    fn answer_at(&self, painter: &egui::Painter, point: Pos2, square: Rect, choice: &Choice) {
        let text = match (self.share_of_chosen(choice), self.why.evaluating) {
            (Some(share), _) => format!("{:.0} %", share * 100.0),
            (None, true) => "…".to_owned(),
            (None, false) => return,
        };
        let galley = painter.layout_no_wrap(text, FontId::proportional(13.0), Color32::WHITE);
        let (off, align) = if point.x > square.center().x {
            (vec2(-12.0, 0.0), Align2::RIGHT_CENTER)
        } else {
            (vec2(12.0, 0.0), Align2::LEFT_CENTER)
        };
        let rect = align.anchor_size(point + off, galley.size()).expand(3.0);
        painter.rect_filled(rect, 3.0, Color32::from_black_alpha(220));
        painter.galley(rect.min + vec2(3.0, 3.0), galley, Color32::WHITE);
    }

    fn slice_axes(&self, ui: &Ui, painter: &egui::Painter, square: Rect, search: &Search, plane: Plane) {
        let (font, colour) = (FontId::proportional(11.0), ui.visuals().text_color());
        let value = |joint: usize, share: f64| joint_value(self, joint, search.value(joint, share));
        for share in [0.0, 0.5, 1.0] {
            let x = square.left() + share as f32 * square.width();
            let align = if share == 0.0 {
                Align2::LEFT_TOP
            } else if share == 1.0 {
                Align2::RIGHT_TOP
            } else {
                Align2::CENTER_TOP
            };
            painter.text(pos2(x, square.bottom() + OFF), align, value(plane.x, share), font.clone(), colour);
            let Some(up) = plane.y else { continue };
            let y = square.bottom() - share as f32 * square.height();
            let align = if share == 0.0 {
                Align2::RIGHT_BOTTOM
            } else if share == 1.0 {
                Align2::RIGHT_TOP
            } else {
                Align2::RIGHT_CENTER
            };
            painter.text(pos2(square.left() - OFF, y), align, value(up, share), font.clone(), colour);
        }
        let below = pos2(square.center().x, square.bottom() + OFF + 13.0);
        let joints = &search.choice().joints;
        painter.text(below, Align2::CENTER_TOP, &joints[plane.x].name, font.clone(), colour);
        if let Some(up) = plane.y {
            let name = painter.layout_no_wrap(joints[up].name.clone(), font.clone(), colour);
            let start = pos2(square.left() - MARGIN.0, square.center().y + name.size().x / 2.0);
            painter.add(egui::epaint::TextShape::new(start, name, colour).with_angle(-std::f32::consts::FRAC_PI_2));
        }
    }
}

/// What the slice's colours and marks mean.
fn legend(ui: &mut Ui) {
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 5.0;
        let quiet = |text: &str| RichText::new(text).weak().small();
        ui.label(quiet("teaches little"));
        let (bar, _) = ui.allocate_exact_size(vec2(60.0, 9.0), Sense::hover());
        let steps = 20;
        for step in 0..steps {
            let strip = Rect::from_min_size(
                bar.min + vec2(bar.width() * step as f32 / steps as f32, 0.0),
                vec2(bar.width() / steps as f32 + 0.5, bar.height()),
            );
            ui.painter().rect_filled(strip, 0.0, viridis(f64::from(step) / f64::from(steps - 1)));
        }
        ui.label(quiet("much"));
        let bold = accent(ui.visuals().dark_mode);
        let mut mark = |text: &str, draw: &dyn Fn(&egui::Painter, Pos2)| {
            ui.horizontal(|ui| {
                ui.spacing_mut().item_spacing.x = 3.0;
                let (place, _) = ui.allocate_exact_size(vec2(16.0, 16.0), Sense::hover());
                draw(ui.painter(), place.center());
                ui.label(quiet(text));
            });
        };
        mark("chosen", &cross);
        mark("divided next", &|painter, centre| {
            let square = Rect::from_center_size(centre, vec2(11.0, 11.0));
            painter.rect_stroke(square, 0.0, Stroke::new(2.0, bold), StrokeKind::Inside);
        });
        mark("tried out", &yours);
    });
}

/// The point that the visitor asks about.
fn yours(painter: &egui::Painter, centre: Pos2) {
    painter.circle(centre, 6.0, Color32::WHITE, Stroke::new(2.5, Color32::BLACK));
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
