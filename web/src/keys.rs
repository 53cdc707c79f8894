//! The keyboard.

use egui::{Context, Event, Key, Modifiers};

use crate::{host::Command, panel::Panel};

/// Every shortcut: its keys as they are written, and what it does.
pub const SHORTCUTS: [(&str, &str); 11] = [
    ("Space", "play or pause"),
    ("Right", "next step; at the end, make one"),
    ("Left", "step back"),
    ("S", "make a step"),
    ("R", "reset the view of the scene"),
    ("Shift R", "reset the run: the same from its start"),
    ("N", "a new seed"),
    ("+  -", "faster, slower"),
    ("T", "the tour"),
    ("F6", "from the controls to the scene and back"),
    ("?", "this help; Esc closes it"),
];

impl Panel {
    /// Handles the pressed keys, unless the visitor is typing, and tells the page which is the case.
    pub fn take_keys(&mut self, ctx: &Context) {
        let typing = ctx.text_edit_focused();
        self.set_typing(typing);
        if ctx.input(|input| input.key_pressed(Key::Escape)) {
            self.help = false;
            self.close_tour();
        }
        if typing {
            return;
        }
        let has_focus = ctx.memory(|memory| memory.focused().is_some());
        let pressed = |key| press_of(ctx, key).is_some();
        // A button with the focus is pressed by Space, a slider moved by arrows.
        if !has_focus {
            if pressed(Key::Space) {
                self.toggle();
            }
            if pressed(Key::ArrowRight) {
                self.forward();
            }
            if pressed(Key::ArrowLeft) {
                self.back();
            }
        }
        if pressed(Key::S) {
            self.make_step();
        }
        match press_of(ctx, Key::R) {
            Some(held) if held.shift => self.reset(),
            Some(_) => self.ask(Command::RestoreView),
            None => {}
        }
        if pressed(Key::N) {
            self.reroll();
        }
        if pressed(Key::Plus) || pressed(Key::Equals) {
            self.change_speed(true);
        }
        if pressed(Key::Minus) {
            self.change_speed(false);
        }
        if pressed(Key::T) && !self.is_external() {
            if self.tour.is_some() {
                self.close_tour();
            } else {
                self.open_tour();
            }
        }
        if pressed(Key::Questionmark) || press_of(ctx, Key::Slash).is_some_and(|held| held.shift) {
            self.help = !self.help;
        }
    }
}

/// The modifiers held down with a key that has just been pressed; `None` if they make it another program's shortcut.
///
/// They are read from the press itself: presses elsewhere on the page are passed on without the modifiers held at the
/// moment.
fn press_of(ctx: &Context, wanted: Key) -> Option<Modifiers> {
    ctx.input(|input| {
        input.events.iter().find_map(|event| match event {
            Event::Key { key, pressed: true, modifiers, .. } if *key == wanted => {
                Some(*modifiers).filter(|held| !(held.command || held.ctrl || held.alt))
            }
            _ => None,
        })
    })
}
