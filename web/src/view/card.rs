//! The cards of a story: at the bottom, each as large as the largest, so that its buttons keep their places, and with a
//! frame around what it speaks of.

use egui::{
    Align, Button, Color32, Context, Frame, LayerId, Layout, Order, Rect, RichText, ScrollArea, Sense, Shape, Stroke,
    StrokeKind, TextStyle, Ui, UiBuilder, vec2,
};

use super::style::accent;
use crate::{
    host::Side,
    panel::Panel,
    stories::{Act, Spot, Story},
};

const MARGIN: f32 = 10.0;
const BUTTONS: f32 = 28.0;
const TITLE: f32 = 24.0;
/// So many actions stand above, where there is no room for all.
const ABOVE: usize = 2;
const NOT_YET: &str = "The run is not over yet. Play it to the end; the result then appears below the chart.";

impl Panel {
    pub(super) fn card_panel(&mut self, ui: &mut Ui) {
        self.card_height = 0.0;
        let Some((story, place, card)) = self.card() else {
            self.card_shown = None;
            return;
        };
        if self.card_shown != Some((self.story, place)) {
            (self.card_shown, self.reveal) = (Some((self.story, place)), Some(card.spot));
        }
        // What has not come yet cannot be spoken of.
        let (text, acts) = match card.spot {
            Spot::Ending if self.ending().is_none() => (NOT_YET, &[Act::PlayOn(10.0)][..]),
            _ => (card.text, card.acts),
        };
        let height = height(ui, story);
        self.card_height = height;
        let frame = Frame::new()
            .fill(ui.visuals().window_fill)
            .stroke(Stroke::new(1.5, accent(ui.visuals().dark_mode)))
            .inner_margin(MARGIN);
        let panel = egui::Panel::bottom("card").resizable(false).exact_size(height).frame(frame);
        panel.show(ui, |ui| {
            ui.horizontal(|ui| {
                let title = format!("{} of {}: {}", place + 1, story.cards.len(), card.title);
                ui.add(egui::Label::new(RichText::new(title).strong().size(15.0)).truncate());
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                    if ui.button("Close").on_hover_text("Closes the cards (Esc)").clicked() {
                        self.close_tour();
                    }
                });
            });
            // What has no room beside “Previous” and “Next” stands above them, and takes its room from the text.
            let is_crowded = self.is_on_story() && is_crowded(ui, acts);
            let (above, beside) = acts.split_at(if is_crowded { ABOVE } else { 0 });
            let buttons = if is_crowded { 2.0 * BUTTONS } else { BUTTONS };
            let room = (ui.available_height() - buttons).max(20.0);
            ScrollArea::vertical().id_salt(place).auto_shrink(false).max_height(room).min_scrolled_height(room).show(
                ui,
                |ui| {
                    ui.set_min_height(room - 4.0);
                    ui.add(egui::Label::new(text).wrap());
                },
            );
            if is_crowded {
                // As high as its room, so that the row below keeps its place.
                let size = vec2(ui.available_width(), BUTTONS - ui.spacing().item_spacing.y);
                let (rect, _) = ui.allocate_exact_size(size, Sense::hover());
                let row = UiBuilder::new().max_rect(rect).layout(Layout::left_to_right(Align::Center));
                self.acts(&mut ui.new_child(row), above, true);
            }
            ui.horizontal(|ui| {
                // From the right, so that they stand in the same place on every card.
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                    let is_last = place + 1 == story.cards.len();
                    if ui.add_enabled(!is_last, Button::new("Next")).clicked() {
                        self.tour = Some(place + 1);
                    }
                    if ui.add_enabled(place > 0, Button::new("Previous")).clicked() {
                        self.tour = Some(place - 1);
                    }
                    let left = Layout::left_to_right(Align::Center);
                    ui.with_layout(left, |ui| self.acts(ui, beside, !is_crowded));
                });
            });
        });
    }

    /// Buttons for actions; the first of all is the one with which the story goes on.
    fn acts(&mut self, ui: &mut Ui, acts: &[Act], with_first: bool) {
        if !self.is_on_story() {
            let open = ui.add_enabled(!self.opening, Button::new(RichText::new("Open this story").strong()));
            if open.on_hover_text("Its scenario and its seed").clicked() {
                self.tell(self.story);
            }
            return;
        }
        let there = |act: &Act| match act {
            Act::Story(title) => self.stories().any(|(_, story)| story.title == *title),
            Act::Game => self.can_play(),
            _ => true,
        };
        let acts: Vec<Act> = acts.iter().copied().filter(there).collect();
        for (index, act) in acts.into_iter().enumerate() {
            let act = self.due(act);
            let idle = match act {
                Act::PlayTo(..) | Act::PlayOn(_) => !self.playing,
                Act::Seeds => self.seeds.as_ref().is_none_or(|seeds| !seeds.running),
                _ => true,
            };
            let text = RichText::new(act.label());
            let button = if index == 0 && with_first { filled(ui, text) } else { Button::new(text) };
            if ui.add_enabled(idle && self.is_ready(), button).clicked() {
                self.act(act);
            }
        }
    }

    /// Draws a frame around what the open card speaks of, or an arrow towards the scene.
    pub(super) fn point(&mut self, ctx: &Context) {
        let Some((.., card)) = self.card() else { return };
        let colour = accent(ctx.global_style().visuals.dark_mode);
        let painter = ctx.layer_painter(LayerId::new(Order::Middle, egui::Id::unique("pointer")));
        let screen = ctx.content_rect();
        if card.spot == Spot::Ellipsoids {
            self.arrow(&painter, screen, colour);
        } else if let Some(rect) = self.spots.get(card.spot) {
            let rect = rect.expand(3.0).intersect(screen.shrink(2.0));
            painter.rect_stroke(rect, 5.0, Stroke::new(2.0, colour), StrokeKind::Inside);
        }
    }

    /// Towards the scene, from the edge that it lies at.
    fn arrow(&self, painter: &egui::Painter, screen: Rect, colour: Color32) {
        let (edge, tip, ahead) = match self.scene {
            Side::Right => ([screen.right_top(), screen.right_bottom()], screen.right_center(), vec2(1.0, 0.0)),
            Side::Left => ([screen.left_top(), screen.left_bottom()], screen.left_center(), vec2(-1.0, 0.0)),
            Side::Above => ([screen.left_top(), screen.right_top()], screen.center_top(), vec2(0.0, -1.0)),
        };
        painter.line_segment(edge, Stroke::new(6.0, colour));
        let (back, side) = (tip - 22.0 * ahead, 12.0 * ahead.rot90());
        painter.add(Shape::convex_polygon(vec![tip, back + side, back - side], colour, Stroke::NONE));
    }
}

/// The button that a story goes on with.
pub(super) fn filled(ui: &Ui, text: RichText) -> Button<'static> {
    let selection = ui.visuals().selection;
    Button::new(text.strong().color(selection.stroke.color)).fill(selection.bg_fill)
}

/// Whether so many actions have no room beside “Previous” and “Next”.
fn is_crowded(ui: &Ui, acts: &[Act]) -> bool {
    acts.len() > ABOVE && ui.ctx().content_rect().width() < super::NARROW
}

/// Room for the longest card of a story, but never more than leaves something to see above it.
fn height(ui: &Ui, story: &Story) -> f32 {
    let width = ui.available_width() - 2.0 * MARGIN - 16.0;
    let font = TextStyle::Body.resolve(ui.style());
    let longest = story.cards.iter().map(|card| {
        let text = ui
            .ctx()
            .fonts_mut(|fonts| fonts.layout(card.text.to_owned(), font.clone(), Color32::WHITE, width).size().y);
        text + if is_crowded(ui, card.acts) { BUTTONS } else { 0.0 }
    });
    let text = longest.fold(0.0, f32::max) + 8.0;
    (text + TITLE + BUTTONS + 2.0 * MARGIN + 8.0).min(ui.ctx().content_rect().height() * 0.34)
}
