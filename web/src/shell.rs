//! The WebAssembly that a browser runs: a canvas, and two doors to the page.

use std::{
    cell::RefCell,
    rc::Rc,
    sync::{Arc, Mutex},
    time::Duration,
};

use egui::accesskit::TreeUpdate;
use wasm_bindgen::prelude::*;

use crate::{
    access::{self, Element},
    acts::{self, Act},
    clicks,
    host::{Command, Event},
    panel::Panel,
};

/// Where drawing is slow, seconds from one frame of a panel that plays to the next, unless the visitor does something: the
/// scene beside it gets the time.
const SPARING: f64 = 0.3;

/// The panel on its canvas.
#[wasm_bindgen]
pub struct PanelHandle {
    runner: eframe::WebRunner,
    panel: Rc<RefCell<Panel>>,
    inbox: Rc<RefCell<Inbox>>,
    command: RefCell<Option<js_sys::Function>>,
    tree: Tree,
    /// The elements that the page has.
    elements: RefCell<Vec<Element>>,
}

#[derive(Default)]
struct Inbox {
    events: Vec<Event>,
    input: Vec<egui::Event>,
    /// What was done to the page's elements; finished a frame after its events.
    acts: Vec<Act>,
    /// The focus is elsewhere on the page.
    released: bool,
    context: Option<egui::Context>,
    /// When the panel was drawn last, seconds as egui counts them.
    drawn_at: f64,
}

/// The latest accessibility tree, until the page takes it.
#[derive(Clone, Default)]
struct Tree(Arc<Mutex<Option<TreeUpdate>>>);

impl egui::Plugin for Tree {
    fn debug_name(&self) -> &'static str {
        "accessibility tree"
    }

    fn output_hook(&mut self, _: &egui::Context, output: &mut egui::FullOutput) {
        if let (Some(update), Ok(mut latest)) = (output.platform_output.accesskit_update.take(), self.0.lock()) {
            *latest = Some(update);
        }
    }
}

struct Shell {
    panel: Rc<RefCell<Panel>>,
    inbox: Rc<RefCell<Inbox>>,
    command: js_sys::Function,
    /// Acts whose events egui has, and which it has not finished.
    acts: Vec<Act>,
}

#[wasm_bindgen]
impl PanelHandle {
    /// A panel that tells `command` (as JSON) what the page is to do.
    #[wasm_bindgen(constructor)]
    #[allow(clippy::new_without_default)]
    pub fn new() -> Self {
        Self {
            runner: eframe::WebRunner::new(),
            panel: Rc::default(),
            inbox: Rc::default(),
            command: RefCell::default(),
            tree: Tree::default(),
            elements: RefCell::default(),
        }
    }

    /// Draws on a canvas from now on; sparingly where that is slow.
    ///
    /// # Errors
    ///
    /// A JavaScript value that says why the canvas cannot be drawn on.
    pub async fn start(
        &self,
        canvas: web_sys::HtmlCanvasElement,
        command: js_sys::Function,
        slow: bool,
    ) -> Result<(), JsValue> {
        self.panel.borrow_mut().drawn_every = if slow { SPARING } else { 0.0 };
        *self.command.borrow_mut() = Some(command.clone());
        let (panel, inbox, tree) = (self.panel.clone(), self.inbox.clone(), self.tree.clone());
        let create: eframe::AppCreator<'static> = Box::new(move |creation| {
            inbox.borrow_mut().context = Some(creation.egui_ctx.clone());
            creation.egui_ctx.set_theme(egui::ThemePreference::System);
            creation.egui_ctx.enable_accesskit();
            creation.egui_ctx.add_plugin(tree);
            Ok(Box::new(Shell { panel, inbox, command, acts: Vec::new() }))
        });
        self.runner.start(canvas, eframe::WebOptions::default(), create).await
    }

    /// Takes in an event, as JSON. What the panel does not know is refused with a reason.
    ///
    /// # Errors
    ///
    /// The reason, as a string, if the JSON is no event that the panel knows.
    pub fn receive(&self, event: &str) -> Result<(), JsValue> {
        let event = serde_json::from_str(event).map_err(|error| JsValue::from_str(&error.to_string()))?;
        self.inbox.borrow_mut().events.push(event);
        if !self.is_sparing() {
            self.repaint_after(0.0);
        }
        Ok(())
    }

    /// Does what is due between two frames of a panel that is drawn sparingly, and returns after how many seconds it is to
    /// be called again, if nothing happens before; nothing if all is done in frames.
    pub fn attend(&self) -> Option<f64> {
        if !self.is_sparing() {
            return None;
        }
        let events = std::mem::take(&mut self.inbox.borrow_mut().events);
        let (again, plays, commands) = {
            let mut panel = self.panel.try_borrow_mut().ok()?;
            events.into_iter().for_each(|event| panel.receive(event));
            let again = panel.tick(now());
            (again, panel.playing, panel.take_commands())
        };
        if let Some(command) = self.command.borrow().as_ref() {
            tell(command, commands);
        }
        let rest = self.inbox.borrow().drawn_at + SPARING - now();
        self.repaint_after(if plays { rest.max(0.0) } else { 0.0 });
        again.filter(|_| plays)
    }

    /// Presses a key that was pressed elsewhere on the page; false if it means nothing here.
    pub fn press(&self, key: &str, shift: bool) -> bool {
        let name = if key == " " { "Space" } else { key };
        let Some(key) = egui::Key::from_name(name) else { return false };
        let modifiers = egui::Modifiers { shift, ..egui::Modifiers::NONE };
        self.push(|inbox| {
            for pressed in [true, false] {
                inbox.input.push(egui::Event::Key { key, physical_key: None, pressed, repeat: false, modifiers });
            }
        });
        true
    }

    /// The elements that the page is to have, as JSON; nothing if they are those that it was given last.
    pub fn elements(&self) -> Option<String> {
        let update = self.tree.0.lock().ok()?.take()?;
        let elements = access::elements(&update);
        let mut known = self.elements.borrow_mut();
        if *known == elements {
            return None;
        }
        let json = serde_json::to_string(&elements).ok();
        *known = elements;
        json
    }

    /// Does what was done to an element, told as JSON.
    ///
    /// # Errors
    ///
    /// The reason, as a string, if the JSON is no act that the panel knows.
    pub fn act(&self, act: &str) -> Result<(), JsValue> {
        let act: Act = serde_json::from_str(act).map_err(|error| JsValue::from_str(&error.to_string()))?;
        self.push(|inbox| {
            inbox.input.extend(act.events());
            inbox.acts.push(act);
        });
        Ok(())
    }

    /// Takes the focus from the widget that has it: it is elsewhere on the page now.
    pub fn release(&self) {
        self.push(|inbox| inbox.released = true);
    }

    /// Why the panel has crashed, if it has.
    pub fn failure(&self) -> Option<String> {
        self.runner.panic_summary().map(|summary| summary.message())
    }

    fn push(&self, add: impl FnOnce(&mut Inbox)) {
        add(&mut self.inbox.borrow_mut());
        self.repaint_after(0.0);
    }

    fn repaint_after(&self, seconds: f64) {
        if let Some(context) = &self.inbox.borrow().context {
            context.request_repaint_after(Duration::from_secs_f64(seconds));
        }
    }

    /// Whether the panel goes on without being drawn each time. Not while it is at work itself.
    fn is_sparing(&self) -> bool {
        self.panel.try_borrow().is_ok_and(|panel| panel.draws_sparingly())
    }
}

/// Now, as egui counts it, seconds.
fn now() -> f64 {
    web_sys::window().and_then(|window| window.performance()).map_or(0.0, |clock| clock.now() / 1e3)
}

/// Has the page do what the panel asks for.
fn tell(page: &js_sys::Function, commands: Vec<Command>) {
    for command in commands {
        // Commands are plain data: they can always be written.
        let json = serde_json::to_string(&command).unwrap_or_default();
        // What the page throws is the page's to report.
        drop(page.call1(&JsValue::NULL, &JsValue::from_str(&json)));
    }
}

impl eframe::App for Shell {
    fn raw_input_hook(&mut self, ctx: &egui::Context, input: &mut egui::RawInput) {
        clicks::allow_for_slow_frames(ctx, input.time);
        input.events.append(&mut self.inbox.borrow_mut().input);
    }

    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        let ctx = ui.ctx().clone();
        let mut inbox = self.inbox.borrow_mut();
        let (events, acts) = (std::mem::take(&mut inbox.events), std::mem::take(&mut inbox.acts));
        let released = std::mem::take(&mut inbox.released);
        inbox.drawn_at = now();
        drop(inbox);
        if released {
            acts::release_focus(&ctx);
        }
        std::mem::replace(&mut self.acts, acts).iter().for_each(|act| act.finish(&ctx));
        if !self.acts.is_empty() {
            ctx.request_repaint();
        }
        let commands = {
            let mut panel = self.panel.borrow_mut();
            events.into_iter().for_each(|event| panel.receive(event));
            panel.ui(ui);
            panel.take_commands()
        };
        tell(&self.command, commands);
    }
}
