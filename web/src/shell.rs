//! The WebAssembly that a browser runs: a canvas, and two doors to the page.

use std::{cell::RefCell, rc::Rc};

use wasm_bindgen::prelude::*;

use crate::{host::Event, panel::Panel};

/// The panel on its canvas.
#[wasm_bindgen]
pub struct PanelHandle {
    runner: eframe::WebRunner,
    inbox: Rc<RefCell<Inbox>>,
}

#[derive(Default)]
struct Inbox {
    events: Vec<Event>,
    keys: Vec<egui::Event>,
    context: Option<egui::Context>,
}

struct Shell {
    panel: Panel,
    inbox: Rc<RefCell<Inbox>>,
    command: js_sys::Function,
}

#[wasm_bindgen]
impl PanelHandle {
    /// A panel that tells `command` (as JSON) what the page is to do.
    #[wasm_bindgen(constructor)]
    #[allow(clippy::new_without_default)]
    pub fn new() -> Self {
        Self { runner: eframe::WebRunner::new(), inbox: Rc::default() }
    }

    /// Draws on a canvas from now on.
    pub async fn start(&self, canvas: web_sys::HtmlCanvasElement, command: js_sys::Function) -> Result<(), JsValue> {
        let inbox = self.inbox.clone();
        let create: eframe::AppCreator<'static> = Box::new(move |creation| {
            inbox.borrow_mut().context = Some(creation.egui_ctx.clone());
            creation.egui_ctx.set_theme(egui::ThemePreference::System);
            Ok(Box::new(Shell { panel: Panel::default(), inbox, command }))
        });
        self.runner.start(canvas, eframe::WebOptions::default(), create).await
    }

    /// Takes in an event, as JSON. What the panel does not know is refused with a reason.
    pub fn receive(&self, event: &str) -> Result<(), JsValue> {
        let event = serde_json::from_str(event).map_err(|error| JsValue::from_str(&error.to_string()))?;
        self.push(|inbox| inbox.events.push(event));
        Ok(())
    }

    /// Presses a key that was pressed elsewhere on the page; false if it means nothing here.
    pub fn press(&self, key: &str, shift: bool) -> bool {
        let name = if key == " " { "Space" } else { key };
        let Some(key) = egui::Key::from_name(name) else { return false };
        let modifiers = egui::Modifiers { shift, ..egui::Modifiers::NONE };
        self.push(|inbox| {
            for pressed in [true, false] {
                inbox.keys.push(egui::Event::Key { key, physical_key: None, pressed, repeat: false, modifiers });
            }
        });
        true
    }

    /// Why the panel has crashed, if it has.
    pub fn failure(&self) -> Option<String> {
        self.runner.panic_summary().map(|summary| summary.message())
    }

    fn push(&self, add: impl FnOnce(&mut Inbox)) {
        let mut inbox = self.inbox.borrow_mut();
        add(&mut inbox);
        if let Some(context) = &inbox.context {
            context.request_repaint();
        }
    }
}

impl eframe::App for Shell {
    fn raw_input_hook(&mut self, _: &egui::Context, input: &mut egui::RawInput) {
        input.events.append(&mut self.inbox.borrow_mut().keys);
    }

    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        let events = std::mem::take(&mut self.inbox.borrow_mut().events);
        events.into_iter().for_each(|event| self.panel.receive(event));
        self.panel.ui(ui);
        for command in self.panel.take_commands() {
            // Commands are plain data: they can always be written.
            let json = serde_json::to_string(&command).unwrap_or_default();
            // What the page throws is the page's to report.
            drop(self.command.call1(&JsValue::NULL, &JsValue::from_str(&json)));
        }
    }
}
