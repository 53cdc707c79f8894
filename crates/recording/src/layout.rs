//! Views in containers, and their blueprint as messages, which Rerun's own builders would write through a stream.
//!
//! A blueprint is a store beside the recording's. Views and containers are entities of it, `view/{uuid}` and
//! `container/{uuid}`; a container names its contents by their paths, and `viewport` names the outermost one.

use uuid::Uuid;

use super::{
    MOTION, RecordingError, TIMELINE,
    ids::RowIds,
    message,
    rerun::{
        Archetype, AsComponents, BlueprintActivationCommand, Chunk, EntityPath, LogMsg, SerializedComponentBatch,
        StoreId, Timeline,
        blueprint::{
            archetypes::{
                ContainerBlueprint, EntityBehavior, PanelBlueprint, TimePanelBlueprint, ViewBlueprint, ViewContents,
                ViewportBlueprint,
            },
            components::{ContainerKind, PanelState, PlayState, RootContainer},
        },
    },
};

/// Who controls the time.
#[derive(Clone, Copy, Debug)]
pub(super) enum Time {
    /// The visitor, from step to step; at first it follows what comes.
    Shown,
    /// The page, which has its own controls.
    Led,
}

/// A view, or a container of others.
pub(super) enum Part {
    View(Box<View>),
    Container(Box<Container>),
}

/// One view of the recording.
pub(super) struct View {
    archetype: ViewBlueprint,
    contents: Vec<String>,
    properties: Vec<(EntityPath, Vec<SerializedComponentBatch>)>,
}

impl View {
    /// A view of one of Rerun's classes, such as `3D`, with a title.
    pub(super) fn new(class: &str, title: &str, origin: &EntityPath) -> Self {
        Self {
            archetype: ViewBlueprint::new(class).with_display_name(title).with_space_origin(origin.to_string()),
            contents: vec!["$origin/**".to_owned()],
            properties: Vec::new(),
        }
    }

    /// Shows what these rules select, instead of everything below the origin.
    pub(super) fn with_contents(mut self, rules: impl IntoIterator<Item = String>) -> Self {
        self.contents = rules.into_iter().collect();
        self
    }

    /// Sets a property, by the name of its archetype.
    pub(super) fn with<A: Archetype + AsComponents>(mut self, property: &A) -> Self {
        self.properties.push((EntityPath::from(A::name().short_name()), property.as_serialized_batches()));
        self
    }

    /// Sets how an entity behaves in this view, and all below it.
    pub(super) fn with_behavior(mut self, entity: &EntityPath, behavior: &EntityBehavior) -> Self {
        let place = EntityPath::from("ViewContents/overrides").join(entity);
        self.properties.push((place, behavior.as_serialized_batches()));
        self
    }
}

/// A container of views and containers, side by side or in tabs.
pub(super) struct Container {
    archetype: ContainerBlueprint,
    contents: Vec<Part>,
}

impl Container {
    fn new(kind: ContainerKind, contents: impl IntoIterator<Item = Part>) -> Self {
        Self { archetype: ContainerBlueprint::new(kind), contents: contents.into_iter().collect() }
    }

    pub(super) fn horizontal(contents: impl IntoIterator<Item = Part>) -> Self {
        Self::new(ContainerKind::Horizontal, contents)
    }

    /// A container of parts one above the other; `shares` are their parts of the height.
    pub(super) fn vertical<const N: usize>(contents: [Part; N], shares: [f32; N]) -> Self {
        let mut container = Self::new(ContainerKind::Vertical, contents);
        container.archetype = container.archetype.with_row_shares(shares);
        container
    }

    /// A container of parts side by side; `shares` are their parts of the width.
    pub(super) fn beside<const N: usize>(contents: [Part; N], shares: [f32; N]) -> Self {
        let mut container = Self::new(ContainerKind::Horizontal, contents);
        container.archetype = container.archetype.with_col_shares(shares);
        container
    }

    /// A container of parts of one height, one above the other.
    pub(super) fn column(contents: impl IntoIterator<Item = Part>) -> Self {
        Self::new(ContainerKind::Vertical, contents)
    }

    pub(super) fn tabs(contents: impl IntoIterator<Item = Part>) -> Self {
        Self::new(ContainerKind::Tabs, contents)
    }

    /// The messages of a blueprint of this container alone, with all panels out of the way: those of the blueprint's
    /// store, the command that activates it last.
    pub(super) fn messages(self, store: StoreId, time: Time) -> Result<Vec<LogMsg>, RecordingError> {
        let (messages, ids) = (vec![message::store_info(&store)], RowIds::of(&store));
        let mut blueprint = Blueprint { messages, store, ids, parts: 0 };
        let root = blueprint.add_part(self.into())?.id;
        let viewport = ViewportBlueprint::new().with_root_container(RootContainer(root.into()));
        blueprint.add("viewport", &viewport.with_auto_layout(false).with_auto_views(false))?;
        blueprint.add("blueprint_panel", &PanelBlueprint::new().with_state(PanelState::Hidden))?;
        blueprint.add("selection_panel", &PanelBlueprint::new().with_state(PanelState::Hidden))?;
        let time = match time {
            Time::Shown => (PanelState::Collapsed, TIMELINE, PlayState::Following),
            Time::Led => (PanelState::Hidden, MOTION, PlayState::Paused),
        };
        let panel = TimePanelBlueprint::new().with_state(time.0).with_timeline(time.1).with_play_state(time.2);
        blueprint.add("time_panel", &panel)?;
        Ok(blueprint.activated())
    }
}

impl From<View> for Part {
    fn from(view: View) -> Self {
        Self::View(Box::new(view))
    }
}

impl From<Container> for Part {
    fn from(container: Container) -> Self {
        Self::Container(Box::new(container))
    }
}

/// A blueprint's store while it is written.
struct Blueprint {
    store: StoreId,
    messages: Vec<LogMsg>,
    ids: RowIds,
    /// How many views and containers it has.
    parts: u128,
}

/// A view or a container that has been written.
struct Written {
    id: Uuid,
    path: EntityPath,
}

impl Blueprint {
    /// Writes a part and all that is in it. Parts are numbered within their blueprint: Rerun keeps every path that it has ever met
    /// in memory, so that other ones in each recording would fill that of a server.
    fn add_part(&mut self, part: Part) -> Result<Written, RecordingError> {
        self.parts += 1;
        let id = Uuid::from_u128(self.parts);
        let path = match part {
            Part::View(view) => {
                let path = EntityPath::from(format!("view/{id}"));
                self.add(path.clone(), &view.archetype)?;
                let contents = ViewContents::new(view.contents.iter().map(String::as_str));
                self.add(path.join(&EntityPath::from("ViewContents")), &contents)?;
                view.properties.iter().try_for_each(|(place, property)| self.add(path.join(place), property))?;
                path
            }
            Part::Container(container) => {
                let Container { archetype, contents } = *container;
                let contents = contents.into_iter().map(|part| self.add_part(part));
                let contents = contents.collect::<Result<Vec<Written>, RecordingError>>()?;
                let path = EntityPath::from(format!("container/{id}"));
                let paths = contents.iter().map(|part| part.path.to_string());
                self.add(path.clone(), &archetype.with_contents(paths))?;
                path
            }
        };
        Ok(Written { id, path })
    }

    fn add(&mut self, entity: impl Into<EntityPath>, what: &dyn AsComponents) -> Result<(), RecordingError> {
        // Viewers look for blueprints on this timeline.
        let time = [(Timeline::new_sequence("blueprint"), 0)];
        let chunk = Chunk::builder(entity).with_serialized_batches(self.ids.next(), time, what.as_serialized_batches());
        self.messages.push(message::data(&self.store, &chunk.build()?)?);
        Ok(())
    }

    /// The finished blueprint, with the command that activates it.
    fn activated(mut self) -> Vec<LogMsg> {
        let command = BlueprintActivationCommand { blueprint_id: self.store, make_active: true, make_default: true };
        self.messages.push(command.into());
        self.messages
    }
}
