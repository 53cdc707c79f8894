//! Reading a description: from its text to links and joints.

use std::{collections::HashMap, ops::Range};

use roxmltree::{Document, Error, Node, ParsingOptions};

use super::{
    UrdfError,
    element::Body,
    plain::{COLON, plain},
    shape::{self, LinkShapes},
    values::{EXPAND, error, only_child, required},
};
use body_schema_engine::{kinematics::JointKind, suggest::did_you_mean};

/// The most elements of a description: more than any robot has.
const MOST_NODES: u32 = 2_000_000;
/// The most attributes of an element.
const MOST_ATTRIBUTES: usize = 200;
/// The most bytes of a link's or a joint's name: it is repeated with every reading.
const MOST_NAME_BYTES: usize = 300;

/// A robot's description with its text.
///
/// Links and the joints between them are checked as a whole; the content of a joint is checked only where a chain
/// contains it, so that an odd gripper that is not asked for does no harm.
#[derive(Clone, Debug)]
pub struct Urdf {
    pub(super) text: String,
    /// The robot's name; empty if the description has none.
    pub(super) name: String,
    pub(super) links: Vec<String>,
    /// What each link looks like.
    pub(super) shapes: Vec<LinkShapes>,
    pub(super) joints: Vec<JointElement>,
    /// The joint that carries each link.
    pub(super) carried_by: Vec<Option<usize>>,
    /// Where `<robot>` begins, as a byte.
    pub(super) start: usize,
}

/// A joint of the description.
#[derive(Clone, Debug)]
pub(super) struct JointElement {
    pub name: String,
    /// The indices of the links.
    pub parent: usize,
    pub child: usize,
    /// Its type as written.
    pub kind: String,
    /// Where it begins, as a byte.
    pub at: usize,
    pub body: Result<Body, UrdfError>,
}

/// A joint with its links, for the search for a chain.
#[derive(Clone, Copy, Debug)]
pub struct JointEnds<'a> {
    /// Its name.
    pub name: &'a str,
    /// The link that carries it.
    pub parent: &'a str,
    /// The link that it carries.
    pub child: &'a str,
    /// Its type as written.
    pub kind: &'a str,
    /// Its content, or why it cannot be on a chain.
    body: Result<&'a Body, &'a UrdfError>,
}

impl JointEnds<'_> {
    /// How it moves on a chain; `None` if it is fixed.
    ///
    /// # Errors
    ///
    /// The reason why it cannot be part of a chain.
    pub fn moves(&self) -> Result<Option<JointKind>, &UrdfError> {
        self.body.map(|body| body.kind.moves())
    }

    /// The joint that it mimics, the first of several.
    pub fn mimics(&self) -> Option<&str> {
        Some(self.body.ok()?.mimic.as_ref()?.terms.first()?.joint.as_str())
    }
}

impl Urdf {
    /// Reads a description. Unknown elements and attributes are ignored, and so are those of other namespaces, declared or
    /// not. Blanks, comments, a byte order mark and a `<!DOCTYPE>` without entities may stand before it.
    ///
    /// # Errors
    ///
    /// [`UrdfError`] if the text is no XML, if links and joints are unexpanded xacro, or if they form no tree.
    pub fn parse(text: &str) -> Result<Self, UrdfError> {
        let options = ParsingOptions { nodes_limit: MOST_NODES, ..ParsingOptions::default() };
        let strict = plain(text, MOST_ATTRIBUTES).map_err(|at| {
            let what = format!("this element has more than {MOST_ATTRIBUTES} attributes");
            UrdfError::at(text, at, what, "leave out those that are none of a URDF's")
        })?;
        let document = Document::parse_with_options(&strict, options).map_err(|found| no_xml(text, &found))?;
        let robot = document.root_element();
        if robot.tag_name().name() != "robot" {
            let what = format!("<{}> is not the description of a robot", as_written(robot.tag_name().name()));
            return Err(error(robot, robot.range().start, what, "give a URDF, whose first element is <robot>"));
        }
        refuse_xacro(robot)?;
        let of_kind = |kind: &'static str| {
            robot.children().filter(move |node| node.is_element() && node.tag_name().name() == kind)
        };
        let (mut links, mut shapes) = (Names::new("link"), Vec::new());
        for node in of_kind("link") {
            links.add(node)?;
            shapes.push(shape::read(node));
        }
        let (mut names, mut joints) = (Names::new("joint"), Vec::new());
        let mut carried_by = vec![None; links.names.len()];
        for node in of_kind("joint") {
            names.add(node)?;
            let name = names.names[joints.len()].clone();
            let (parent, _) = link_of(node, "parent", &name, &links)?;
            let (child, place) = link_of(node, "child", &name, &links)?;
            if let Some(other) = carried_by[child].replace(joints.len()) {
                let JointElement { name: other, .. } = &joints[other];
                let what = format!("link `{}` hangs on joint `{other}` already", links.names[child]);
                return Err(error(node, place.start, what, "a link hangs on one joint; correct one of the two"));
            }
            let kind = node.attribute("type").unwrap_or_default().to_owned();
            joints.push(JointElement { name, parent, child, kind, at: node.range().start, body: Body::read(node) });
        }
        let start = robot.range().start;
        let name = robot.attribute("name").unwrap_or_default().to_owned();
        Ok(Self { text: text.to_owned(), name, links: links.names, shapes, joints, carried_by, start })
    }

    /// The description as it was read.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The robot's name; empty if the description has none.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The link that hangs on nothing, the first of [several](Self::roots).
    pub fn root(&self) -> Option<&str> {
        self.roots().next()
    }

    /// The links that hang on nothing and on which others hang, in the file's order; all of them where there is no joint.
    pub fn roots(&self) -> impl Iterator<Item = &str> {
        let carries = self.carries();
        let is_root =
            move |link: &usize| self.carried_by[*link].is_none() && (carries[*link] || self.joints.is_empty());
        (0..self.links.len()).filter(is_root).map(|link| self.links[link].as_str())
    }

    /// The links on which nothing hangs and that hang on others, in the file's order; all of them where there is no joint.
    pub fn leaves(&self) -> impl Iterator<Item = &str> {
        let carries = self.carries();
        let is_leaf =
            move |link: &usize| !carries[*link] && (self.carried_by[*link].is_some() || self.joints.is_empty());
        (0..self.links.len()).filter(is_leaf).map(|link| self.links[link].as_str())
    }

    /// Whether others hang on each link.
    fn carries(&self) -> Vec<bool> {
        let mut carries = vec![false; self.links.len()];
        self.joints.iter().for_each(|joint| carries[joint.parent] = true);
        carries
    }

    /// Its joints, in the file's order.
    pub fn joints(&self) -> impl Iterator<Item = JointEnds<'_>> {
        (0..self.joints.len()).map(|joint| self.joint_ends(joint))
    }

    /// The joints on which a link hangs, the one that carries it first.
    pub fn carriers<'a>(&'a self, link: &str) -> Vec<JointEnds<'a>> {
        let mut carriers = Vec::new();
        let mut link = self.links.iter().position(|known| known == link);
        while let Some(joint) =
            link.and_then(|link| self.carried_by[link]).filter(|_| carriers.len() < self.joints.len())
        {
            carriers.push(self.joint_ends(joint));
            link = Some(self.joints[joint].parent);
        }
        carriers
    }

    fn joint_ends(&self, joint: usize) -> JointEnds<'_> {
        let JointElement { name, parent, child, kind, body, .. } = &self.joints[joint];
        let (parent, child) = (self.links[*parent].as_str(), self.links[*child].as_str());
        JointEnds { name, parent, child, kind, body: body.as_ref() }
    }

    /// The names of its links, in the file's order.
    pub fn links(&self) -> &[String] {
        &self.links
    }
}

/// The names of one kind of element, each used once.
struct Names {
    kind: &'static str,
    names: Vec<String>,
    index: HashMap<String, usize>,
    places: Vec<usize>,
}

impl Names {
    fn new(kind: &'static str) -> Self {
        Self { kind, names: Vec::new(), index: HashMap::new(), places: Vec::new() }
    }

    fn add(&mut self, node: Node) -> Result<(), UrdfError> {
        let (name, place) = required(node, "name")?;
        if name.len() > MOST_NAME_BYTES {
            let what = format!("the name of this {} has {} bytes", self.kind, name.len());
            return Err(error(node, place.start, what, format!("write a name of at most {MOST_NAME_BYTES}")));
        }
        if let Some(first) = self.index.insert(name.to_owned(), self.names.len()) {
            let text = node.document().input_text();
            let first = UrdfError::at(text, self.places[first], "", "").line;
            let what = format!("a {} `{name}` is on line {first} already", self.kind);
            return Err(error(node, place.start, what, format!("give each {} a name of its own", self.kind)));
        }
        self.names.push(name.to_owned());
        self.places.push(place.start);
        Ok(())
    }
}

/// The link that a joint's `<parent>` or `<child>` names, and where.
fn link_of(joint: Node, tag: &str, name: &str, links: &Names) -> Result<(usize, Range<usize>), UrdfError> {
    let Some(node) = only_child(joint, tag)? else {
        let hint = format!("add <{tag} link=\"…\"/>");
        return Err(error(joint, joint.range().start, format!("joint `{name}` has no <{tag}>"), hint));
    };
    let (link, place) = required(node, "link")?;
    if let Some(&index) = links.index.get(link) {
        return Ok((index, place));
    }
    let hint = did_you_mean(link, links.names.iter().map(String::as_str), || format!("add <link name=\"{link}\"/>"));
    Err(error(node, place.start, format!("there is no link `{link}`, which joint `{name}` names"), hint))
}

/// The name of an element as the description has it.
fn as_written(name: &str) -> String {
    name.replace(COLON, ":")
}

/// Refuses unexpanded xacro where the kinematics are: between links and joints, and in joints. What is left of a template
/// elsewhere, such as a colour in a `<visual>`, does not affect how the robot moves.
fn refuse_xacro(robot: Node) -> Result<(), UrdfError> {
    let declared = |prefix: &str| {
        let mut attributes = robot.attributes();
        let name = format!("xmlns{COLON}{prefix}");
        attributes
            .any(|attribute| attribute.name() == name && attribute.value().trim_end_matches('/').ends_with("/xacro"))
    };
    let is_xacro = |node: &Node| {
        let prefix = node.tag_name().name().split_once(COLON).map(|(prefix, _)| prefix);
        prefix.is_some_and(|prefix| prefix == "xacro" || declared(prefix))
    };
    let of_joints =
        robot.children().filter(|node| node.tag_name().name() == "joint").flat_map(|joint| joint.descendants());
    let mut found: Vec<Node> = robot.children().chain(of_joints).filter(is_xacro).collect();
    found.sort_by_key(|node| node.range().start);
    match found.first() {
        None => Ok(()),
        Some(node) => {
            let what = format!("<{}>: this is a template in xacro, not a URDF", as_written(node.tag_name().name()));
            Err(error(*node, node.range().start, what, EXPAND))
        }
    }
}

fn no_xml(text: &str, found: &Error) -> UrdfError {
    let position = found.pos();
    let before = text.trim_start_matches('\u{feff}').split('<').next().unwrap_or_default().trim();
    let (what, hint) = match found {
        Error::DtdDetected => {
            ("its <!DOCTYPE> defines entities".to_owned(), "remove it, and write what they stand for".to_owned())
        }
        _ if text.trim().is_empty() => ("the file is empty".to_owned(), "give a URDF".to_owned()),
        _ if !before.is_empty() && text.contains("<robot") => {
            let shown: String = before.chars().take(40).collect();
            let hint = "remove what stands before <?xml or <robot: often what a program has said of itself".to_owned();
            (format!("this is not XML: it begins with `{shown}`"), hint)
        }
        _ => {
            let message = found.to_string();
            let what = message.rsplit_once(" at ").map_or(message.as_str(), |(what, _)| what);
            (format!("this is not XML: {what}"), "correct it, or write the file anew from its source".to_owned())
        }
    };
    UrdfError { line: position.row as usize, column: position.col as usize, what, hint }
}
