//! Actions on the elements that stand for the panel's widgets, from visitors who do not see its canvas, in egui's form.

use egui::accesskit::{Action, ActionData, ActionRequest, NodeId, TreeId};
use serde::Deserialize;

/// An action on an element.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Act {
    /// The element.
    id: String,
    /// The kind of action.
    #[serde(flatten)]
    deed: Deed,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "act", rename_all = "snake_case")]
enum Deed {
    /// It was pressed.
    Click,
    /// It was pressed, in a list that is closed by that.
    Choose,
    /// It was given a number.
    Set { number: f64 },
    /// It was given a text.
    Enter { text: String },
    /// It is to be scrolled into view.
    Show,
}

impl Act {
    /// The events that carry it out in egui.
    pub fn events(&self) -> Vec<egui::Event> {
        let Ok(node) = self.id.parse() else { return Vec::new() };
        let request = |action, data| {
            let request = ActionRequest { action, target_tree: TreeId::ROOT, target_node: NodeId(node), data };
            egui::Event::AccessKitActionRequest(request)
        };
        match &self.deed {
            Deed::Click | Deed::Choose => vec![request(Action::Click, None)],
            Deed::Set { number } => vec![request(Action::SetValue, Some(ActionData::NumericValue(*number)))],
            Deed::Enter { text } => vec![request(Action::SetValue, Some(ActionData::Value(text.as_str().into())))],
            Deed::Show => vec![request(Action::ScrollIntoView, None)],
        }
    }

    /// What egui does only when a pointer is released: called a frame after the events.
    pub fn finish(&self, ctx: &egui::Context) {
        if self.deed == Deed::Choose {
            egui::Popup::close_all(ctx);
        }
    }
}

/// Takes the focus from the widget that has it.
pub fn release_focus(ctx: &egui::Context) {
    ctx.memory_mut(|memory| {
        if let Some(id) = memory.focused() {
            memory.surrender_focus(id);
        }
    });
}
