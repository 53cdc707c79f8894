//! The panel for those who do not see its canvas: AccessKit's tree in the reduced form from which the page builds real
//! buttons, fields and tables. What is done to them is in [`acts`](crate::acts).
//!
//! What is a table says so by the roles of its parts: [`Role::Table`], [`Role::Row`], and [`Role::ColumnHeader`] or
//! [`Role::Cell`].

use std::collections::HashMap;

use egui::{
    Role,
    accesskit::{Node, NodeId, Toggled, TreeUpdate},
};
use serde::Serialize;

/// An element of the page.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Element {
    /// The widget's id in AccessKit's tree; a text, as JavaScript's numbers are too short.
    pub id: String,
    /// What it is.
    pub kind: Kind,
    /// How it is called.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// The text of a field or the choice of a combo box.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub text: Option<String>,
    /// The number of a slider or a field.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub number: Option<Number>,
    /// Whether it is on, pressed or open.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on: Option<bool>,
    /// Whether it does nothing at the moment.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub disabled: bool,
    /// Left, top, width and height on the canvas, points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub place: Option<[i32; 4]>,
    /// In which of egui's panels it is, from the top; 0 for popups and windows.
    pub pane: usize,
    /// What is in it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub children: Vec<Element>,
}

/// What an element is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Words.
    #[default]
    Text,
    /// The words above a part.
    Heading,
    /// A picture that has a name.
    Image,
    /// A button; one that stays pressed has `on`.
    Button,
    /// A box to tick.
    Checkbox,
    /// One of several.
    Radio,
    /// A slider.
    Range,
    /// A field for a number.
    Number,
    /// A field for a text.
    Field,
    /// A button that opens a list.
    Combobox,
    /// A link.
    Link,
    /// Elements that belong together: a list that is open, a window.
    Group,
    /// A table: its children are rows.
    Table,
    /// A row: its children are cells.
    Row,
    /// A cell.
    Cell,
    /// A cell of the first row.
    Head,
}

/// A number within its range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Number {
    /// The number.
    pub value: f64,
    /// The least, if there is one.
    pub min: Option<f64>,
    /// The greatest, if there is one.
    pub max: Option<f64>,
    /// The distance to the next, if there is one.
    pub step: Option<f64>,
}

/// The elements of a complete tree, in reading order.
pub fn elements(update: &TreeUpdate) -> Vec<Element> {
    let nodes = update.nodes.iter().map(|(id, node)| (*id, node)).collect();
    let mut tree = Tree { nodes, pane: 0 };
    let mut elements = Vec::new();
    if let Some(root) = update.tree.as_ref().and_then(|info| tree.nodes.get(&info.root).copied()) {
        tree.read_children(root, 0, &mut elements);
    }
    elements
}

struct Tree<'a> {
    nodes: HashMap<NodeId, &'a Node>,
    /// Panels seen so far.
    pane: usize,
}

impl Tree<'_> {
    fn read(&mut self, id: NodeId, pane: usize, elements: &mut Vec<Element>) {
        let Some(node) = self.nodes.get(&id).copied() else { return };
        if node.is_hidden() {
            return;
        }
        let name = self.name(node);
        let kind = match node.role() {
            Role::TextRun | Role::ScrollBar | Role::Splitter | Role::Tooltip => return,
            Role::Pane => {
                self.pane += 1;
                return self.read_children(node, self.pane, elements);
            }
            Role::Table | Role::Grid => {
                let mut table = Element { kind: Kind::Table, name, pane, id: id.0.to_string(), ..Element::default() };
                self.parts(node, pane, &mut table.children);
                elements.push(table);
                return;
            }
            Role::ListBox | Role::Menu | Role::Dialog | Role::Window => Kind::Group,
            Role::Label => Kind::Text,
            Role::Heading => Kind::Heading,
            Role::Button | Role::DefaultButton | Role::Tab | Role::DisclosureTriangle => Kind::Button,
            Role::MenuItem | Role::ListBoxOption => Kind::Button,
            Role::CheckBox | Role::Switch => Kind::Checkbox,
            Role::RadioButton => Kind::Radio,
            Role::Slider => Kind::Range,
            Role::SpinButton | Role::NumberInput => Kind::Number,
            Role::TextInput | Role::MultilineTextInput => Kind::Field,
            Role::ComboBox => Kind::Combobox,
            Role::Link => Kind::Link,
            Role::Image | Role::Canvas | Role::GraphicsObject if !name.is_empty() => Kind::Image,
            _ => return self.read_children(node, pane, elements),
        };
        if name.is_empty() && !matches!(kind, Kind::Group | Kind::Combobox) {
            return self.read_children(node, pane, elements);
        }
        let mut element = Element { kind, name, pane, ..Element::of(id, node) };
        if kind == Kind::Group {
            self.read_children(node, 0, &mut element.children);
            if !element.children.is_empty() {
                elements.push(element);
            }
            return;
        }
        elements.push(element);
        // The list that a widget has opened.
        self.read_children(node, 0, elements);
    }

    fn read_children(&mut self, node: &Node, pane: usize, elements: &mut Vec<Element>) {
        for child in node.children() {
            self.read(*child, pane, elements);
        }
    }

    /// The rows of a table, or the cells of a row, whatever holds them.
    fn parts(&mut self, node: &Node, pane: usize, elements: &mut Vec<Element>) {
        for id in node.children() {
            let Some(child) = self.nodes.get(id).copied() else { continue };
            let kind = match child.role() {
                Role::Row => Kind::Row,
                Role::Cell => Kind::Cell,
                Role::ColumnHeader => Kind::Head,
                _ => {
                    self.parts(child, pane, elements);
                    continue;
                }
            };
            let mut part = Element { id: id.0.to_string(), kind, pane, ..Element::default() };
            match kind {
                Kind::Row => self.parts(child, pane, &mut part.children),
                _ => self.read_children(child, pane, &mut part.children),
            }
            elements.push(part);
        }
    }

    /// What a node is called: by itself, by its label, or by what it says.
    fn name(&self, node: &Node) -> String {
        let own = node.label().filter(|label| !label.is_empty()).map(str::to_owned);
        let labels = || {
            let labels = node.labelled_by().iter().filter_map(|id| self.nodes.get(id));
            let texts: Vec<&str> = labels.filter_map(|label| label.label().or(label.value())).collect();
            (!texts.is_empty()).then(|| texts.join(" "))
        };
        let said = || if node.role() == Role::Label { node.value() } else { node.placeholder() };
        own.or_else(labels).or_else(|| said().map(str::to_owned)).unwrap_or_default().trim().to_owned()
    }
}

impl Element {
    fn of(id: NodeId, node: &Node) -> Self {
        let number = node.numeric_value().filter(|value| value.is_finite()).map(|value| Number {
            value,
            min: node.min_numeric_value(),
            max: node.max_numeric_value(),
            step: node.numeric_value_step(),
        });
        let is_field = matches!(node.role(), Role::TextInput | Role::MultilineTextInput | Role::ComboBox);
        let place = node.bounds().map(|bounds| {
            [bounds.x0, bounds.y0, bounds.x1 - bounds.x0, bounds.y1 - bounds.y0].map(|points| points.round() as i32)
        });
        Self {
            id: id.0.to_string(),
            text: is_field.then(|| node.value().unwrap_or_default().to_owned()),
            number,
            on: node.is_expanded().or_else(|| node.toggled().map(|toggled| toggled == Toggled::True)),
            disabled: node.is_disabled(),
            place,
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::acts::Act;

    struct Form {
        ctx: egui::Context,
        pressed: u32,
        share: f64,
        seed: String,
        entered: u32,
        choice: u32,
    }

    impl Form {
        fn new() -> Self {
            let ctx = egui::Context::default();
            ctx.enable_accesskit();
            Self { ctx, pressed: 0, share: 0.5, seed: "1".to_owned(), entered: 0, choice: 1 }
        }

        fn run(&mut self, events: Vec<egui::Event>, finished: Option<&Act>) -> Vec<Element> {
            let input = egui::RawInput { events, ..egui::RawInput::default() };
            let ctx = self.ctx.clone();
            let mut output = ctx.run_ui(input, |ui| {
                finished.into_iter().for_each(|act| act.finish(ui.ctx()));
                egui::CentralPanel::default().show(ui, |ui| {
                    self.pressed += u32::from(ui.button("Play").clicked());
                    let label = ui.label("Share");
                    ui.add(egui::Slider::new(&mut self.share, 0.0..=1.0).show_value(false)).labelled_by(label.id);
                    let label = ui.label("Seed");
                    let field = ui.text_edit_singleline(&mut self.seed).labelled_by(label.id);
                    self.entered += u32::from(field.changed() && !field.has_focus());
                    egui::ComboBox::from_id_salt("list").selected_text("one").show_ui(ui, |ui| {
                        ui.selectable_value(&mut self.choice, 2, "two");
                    });
                    let part = |role| egui::UiBuilder::new().accessibility_role(role);
                    ui.scope_builder(part(Role::Table).accessibility_label("Learners"), |ui| {
                        for (row, texts) in [["Learner", "Error"], ["active", "3"], ["random", "20"]].iter().enumerate()
                        {
                            let cell = if row == 0 { Role::ColumnHeader } else { Role::Cell };
                            ui.scope_builder(part(Role::Row).id_salt(row), |ui| {
                                for text in texts {
                                    ui.scope_builder(part(cell).id_salt(text), |ui| ui.label(*text));
                                }
                            });
                        }
                    });
                });
            });
            output.textures_delta.clear();
            elements(&output.platform_output.accesskit_update.expect("a tree"))
        }

        fn act(&mut self, act: serde_json::Value) -> Vec<Element> {
            let act: Act = serde_json::from_value(act).expect("an act");
            self.run(act.events(), None);
            self.run(Vec::new(), Some(&act));
            self.run(Vec::new(), None)
        }
    }

    fn find<'a>(elements: &'a [Element], kind: Kind, name: &str) -> &'a Element {
        elements.iter().find(|one| (one.kind, one.name.as_str()) == (kind, name)).expect(name)
    }

    #[test]
    fn widgets_become_named_elements_and_do_what_these_ask_for() {
        let mut form = Form::new();
        let elements = form.run(Vec::new(), None);
        let slider = find(&elements, Kind::Range, "Share");
        assert_eq!(
            slider.number.map(|number| (number.value, number.min, number.max)),
            Some((0.5, Some(0.0), Some(1.0)))
        );
        let seed = find(&elements, Kind::Field, "Seed");
        assert_eq!(seed.text.as_deref(), Some("1"));
        let play = find(&elements, Kind::Button, "Play");
        assert!(play.place.is_some_and(|[.., width, height]| width > 10 && height > 10));
        form.act(serde_json::json!({ "id": play.id, "act": "click" }));
        form.act(serde_json::json!({ "id": slider.id, "act": "set", "number": 0.25 }));
        form.act(serde_json::json!({ "id": seed.id, "act": "enter", "text": "7" }));
        assert_eq!((form.pressed, form.share, form.seed.as_str()), (1, 0.25, "7"));
        assert_eq!(form.entered, 1, "a text is taken in without the focus, so that the page keeps it");
        // An id of no widget, or of none that can be, changes nothing.
        form.act(serde_json::json!({ "id": "12", "act": "click" }));
        form.act(serde_json::json!({ "id": "no number", "act": "click" }));
        assert_eq!(form.pressed, 1);
    }

    #[test]
    fn a_list_opens_as_a_group_and_closes_with_the_choice() {
        let mut form = Form::new();
        let elements = form.run(Vec::new(), None);
        let list = elements.iter().find(|one| one.kind == Kind::Combobox).expect("a combo box").clone();
        assert_eq!(list.text.as_deref(), Some("one"));
        let elements = form.act(serde_json::json!({ "id": list.id, "act": "click" }));
        let group = elements
            .iter()
            .find(|one| one.kind == Kind::Group)
            .unwrap_or_else(|| panic!("an open list in {elements:#?}"));
        let two = find(&group.children, Kind::Button, "two");
        let elements = form.act(serde_json::json!({ "id": two.id, "act": "choose" }));
        assert_eq!(form.choice, 2);
        assert!(!elements.iter().any(|one| one.kind == Kind::Group));
    }

    #[test]
    fn a_table_has_a_head_and_rows() {
        let elements = Form::new().run(Vec::new(), None);
        let table = find(&elements, Kind::Table, "Learners");
        let cells = |row: &Element| -> Vec<(Kind, String)> {
            row.children.iter().map(|cell| (cell.kind, cell.children[0].name.clone())).collect()
        };
        let rows: Vec<_> = table.children.iter().map(cells).collect();
        let row = |kind, texts: [&str; 2]| texts.map(|text| (kind, text.to_owned())).to_vec();
        assert_eq!(
            rows,
            [
                row(Kind::Head, ["Learner", "Error"]),
                row(Kind::Cell, ["active", "3"]),
                row(Kind::Cell, ["random", "20"])
            ]
        );
    }
}
