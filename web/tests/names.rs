//! Everything that can be used has a name for those who do not see it.

use body_schema_panel::settings::Tab;
use egui::{Key, accesskit::Role};
use egui_kittest::kittest::{NodeT, Queryable};

use crate::support::{Page, Server};

const USED: [Role; 10] = [
    Role::Button,
    Role::CheckBox,
    Role::ComboBox,
    Role::Image,
    Role::Link,
    Role::RadioButton,
    Role::Slider,
    Role::SpinButton,
    Role::Table,
    Role::TextInput,
];

fn all_have_names(page: &Page, state: &str) {
    for role in USED {
        for node in page.harness.query_all_by_role(role) {
            let node = node.accesskit_node();
            let name = node.label().unwrap_or_default();
            assert!(!name.trim().is_empty(), "{state}: a {role:?} at {:?} has no name", node.bounding_box());
        }
    }
}

#[test]
fn everything_that_can_be_used_has_a_name() {
    let mut page = Page::with_session("learners=active,random,active-greedy,global");
    page.press(Key::T);
    all_have_names(&page, "a card");
    page.press(Key::Questionmark);
    all_have_names(&page, "help");
    page.press(Key::Escape);
    for tab in [Tab::Charts, Tab::Why, Tab::Share] {
        page.harness.state_mut().settings.tab = tab;
        page.run();
        page.tell(page.server.selection("active"));
        all_have_names(&page, &format!("{tab:?}"));
    }
    page.click("Add a learner…");
    all_have_names(&page, "more learners");

    let mut page = Page::open("play=human");
    page.tell(Server::scenarios());
    page.open_session();
    all_have_names(&page, "a game");

    let mut page = Page::with_session("learners=global&speed=100&to=12&stop=never");
    page.press(Key::Space);
    page.make_steps(12);
    page.harness.state_mut().run_seeds();
    page.tell(page.server.other_seed(2, 12));
    all_have_names(&page, "an ending");
}

#[test]
fn what_has_the_focus_is_the_same_widget_whatever_comes_and_goes() {
    let mut page = Page::with_session("tab=share&learners=active,random&speed=100&to=12&stop=never");
    let names = ["Step", "New seed", "Share", "Copy link", "recording.rrd", "Copy command"];
    let ids = |page: &Page| names.map(|name| page.harness.get_by_label(name).accesskit_node().id());
    let before = ids(&page);
    page.press(Key::T);
    assert!(page.has("1 of 5"));
    assert_eq!(ids(&page), before, "with a card");
    page.press(Key::Escape);
    page.tell(
        serde_json::json!({ "is": "copied", "done": true, "note": "Copied. Only this machine can open this link." }),
    );
    assert_eq!(ids(&page), before, "with a notice");
    page.press(Key::Space);
    page.make_steps(12);
    assert!(page.harness.state().ending().is_some());
    assert_eq!(ids(&page), before, "with an ending");
}
