//! Movements until accurate over other seeds: a dot for each seed, a line at the median.

use egui::{Align2, FontId, Sense, Stroke, Ui, WidgetInfo, accesskit::Role, pos2, vec2};

use crate::{
    colours,
    panel::Panel,
    seeds::{SeedRuns, median},
};

const ROW: f32 = 26.0;
const AXIS: f32 = 18.0;
/// Room for names at the left and for medians at the right.
const NAMES: f32 = 76.0;
const MEDIANS: f32 = 96.0;

impl Panel {
    /// How the other seeds ended, once some have.
    pub(super) fn other_endings(&self, ui: &mut Ui) {
        let Some(seeds) = self.other_seeds().filter(|seeds| seeds.done() > 0) else { return };
        self.distribution(ui, seeds);
        if let Some(sentence) = self.wins(seeds) {
            ui.label(sentence);
        }
    }

    fn distribution(&self, ui: &mut Ui, seeds: &SeedRuns) {
        let Some(description) = self.description().filter(|description| description.truth.is_some()) else { return };
        let all: Vec<Vec<Option<u64>>> = (0..description.learners.len()).map(|one| seeds.finishes(one)).collect();
        let most = seeds.steps() as f64;
        let least = all.iter().flatten().flatten().min().map_or(1.0, |least| (*least as f64 * 0.7).max(1.0));
        let height = ROW * all.len() as f32 + AXIS;
        let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), height), Sense::hover());
        let (left, right) = (rect.left() + NAMES, rect.right() - MEDIANS);
        let x = |value: f64| {
            let share = (value / least).ln() / (most / least).ln().max(f64::MIN_POSITIVE);
            left + share.clamp(0.0, 1.0) as f32 * (right - left)
        };
        let (painter, text) = (ui.painter(), ui.visuals().text_color());
        let font = FontId::proportional(12.0);
        let bottom = rect.bottom() - AXIS;
        for tick in
            [1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0].into_iter().filter(|t| (least..=most).contains(t))
        {
            let line = Stroke::new(1.0, ui.visuals().widgets.noninteractive.bg_stroke.color);
            painter.line_segment([pos2(x(tick), rect.top()), pos2(x(tick), bottom)], line);
            painter.text(pos2(x(tick), bottom + 2.0), Align2::CENTER_TOP, tick.to_string(), font.clone(), text);
        }
        let slots = colours::slots(description);
        let mut words = String::from("Movements until accurate over other seeds.");
        for (index, (learner, finishes)) in description.learners.iter().zip(&all).enumerate() {
            let y = rect.top() + ROW * (index as f32 + 0.5);
            let colour = colours::learner(slots[index]);
            painter.text(pos2(rect.left(), y), Align2::LEFT_CENTER, &learner.name, font.clone(), text);
            for (place, finish) in finishes.iter().enumerate() {
                // One above the other where they are many.
                let at = |value: f64| pos2(x(value), y + ((place % 3) as f32 - 1.0) * 5.0);
                match finish {
                    Some(movements) => painter.circle_filled(at(*movements as f64), 3.5, colour),
                    None => painter.circle_stroke(at(most), 3.5, Stroke::new(1.5, colour)),
                };
            }
            let said = match median(finishes) {
                Some(middle) => {
                    let ends = [pos2(x(middle), y - 11.0), pos2(x(middle), y + 11.0)];
                    painter.line_segment(ends, Stroke::new(2.5, text));
                    format!("median {middle:.0}")
                }
                None => format!("median > {most:.0}"),
            };
            words += &format!(" {}: {said}.", learner.name);
            painter.text(pos2(right + 12.0, y), Align2::LEFT_CENTER, said, font.clone(), text);
        }
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &words));
        let missing = all.iter().flatten().filter(|finish| finish.is_none()).count();
        let mut note = "a dot: a seed; upright line: the median".to_owned();
        if missing > 0 {
            note += &format!("; hollow: not within {most:.0}");
        }
        ui.label(egui::RichText::new(note).weak().small());
    }

    /// On how many seeds each learner did better than the next, in the order in which this run ended.
    fn wins(&self, seeds: &SeedRuns) -> Option<String> {
        let description = self.description()?;
        let order: Vec<usize> = self.ending()?.outcomes.iter().map(|(learner, _)| *learner).collect();
        let all = seeds.outcomes();
        let better = if description.truth.is_some() { "needed fewer movements" } else { "did better" };
        let clauses = order.windows(2).enumerate().map(|(place, pair)| {
            let [a, b] = [pair[0], pair[1]];
            let won = all.iter().filter(|outcomes| outcomes[a].is_better_than(outcomes[b])).count();
            let [a, b] = [a, b].map(|learner| description.learners[learner].name.as_str());
            match place {
                0 => format!("{a} {better} than {b} on {won} of {} other seeds", all.len()),
                _ => format!("{a} than {b} on {won}"),
            }
        });
        let clauses: Vec<String> = clauses.collect();
        (!clauses.is_empty()).then(|| clauses.join(", ") + ".")
    }
}
