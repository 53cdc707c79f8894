//! The search for the chain of a description that a table's columns move.

use super::{
    Guess, InitError, Sources, columns,
    named::{carried, column},
};
use body_schema_robot::{Chain, Follows, JointEnds, Urdf, UrdfError};

/// The search for the chain.
pub struct ChainSearch<'a> {
    pub sources: &'a Sources<'a>,
    pub urdf: &'a Urdf,
    /// The table's titles.
    pub titles: &'a [String],
}

impl ChainSearch<'_> {
    /// The chain that was asked for, or else the one that the columns move; how it was found is added to `guesses`.
    ///
    /// # Errors
    ///
    /// [`InitError`] if there is no such chain, if several are equally good, or if columns of joints behind it would be
    /// ignored.
    pub fn chain(&self, guesses: &mut Vec<Guess>) -> Result<Chain, InitError> {
        let Some(tip) = self.sources.tip else {
            return match self.sources.base {
                Some(base) => self.longest(&[base], guesses),
                None => self.longest(&self.urdf.roots().collect::<Vec<_>>(), guesses),
            };
        };
        let base = match (self.sources.base, self.urdf.carriers(tip).last()) {
            (Some(base), _) => base.to_owned(),
            (None, Some(first)) => {
                guesses.push(self.of_base(first.parent));
                first.parent.to_owned()
            }
            (None, None) => {
                let root = self.urdf.root().unwrap_or_default();
                guesses.push(self.of_base(root));
                root.to_owned()
            }
        };
        let chain = self.urdf.chain(&base, tip).map_err(|error| self.refused(&base, tip, error))?;
        self.complete(&chain)?;
        Ok(chain)
    }

    /// Whether every joint of a chain has a column.
    ///
    /// # Errors
    ///
    /// [`InitError::Misfit`] with those that have none.
    pub fn complete(&self, chain: &Chain) -> Result<(), InitError> {
        let missing = self.without_column(chain);
        if missing.is_empty() {
            return Ok(());
        }
        Err(InitError::Misfit {
            what: format!(
                "{} has no column for {}; its columns are {}",
                self.sources.table_file,
                missing.join(", "),
                self.titles.join(", ")
            ),
            hint: "title a column with each joint's name (`_deg` and `_mm` at its end say the unit), name another --tip, or say at which sum of others a linkage \
                   holds it: --coupled JOINT=SUM"
                .to_owned(),
        })
    }

    /// The chain from one of `bases` with the most joints that all have columns. Of chains with the same joints, the one whose tip carries
    /// nothing is taken, if there is only one, otherwise the one that ends at the link behind the last joint.
    ///
    /// # Errors
    ///
    /// Those of [`chain`](Self::chain).
    pub fn longest(&self, bases: &[&str], guesses: &mut Vec<Guess>) -> Result<Chain, InitError> {
        let all = bases.iter().flat_map(|base| self.urdf.links().iter().map(move |link| (*base, link)));
        let chains = all.filter_map(|(base, link)| self.urdf.chain(base, link).ok());
        let fitting: Vec<Chain> = chains.filter(|chain| self.without_column(chain).is_empty()).collect();
        let most = fitting.iter().map(|chain| chain.readings.len()).max().unwrap_or(0);
        let mut best: Vec<&Chain> = fitting.iter().filter(|chain| chain.readings.len() == most).collect();
        best.sort_by_key(|chain| chain.segments.len());
        let Some(first) = best.first() else { return Err(self.none_fits(bases)) };
        // Those that move by the same.
        let mut alike: Vec<Vec<&Chain>> = Vec::new();
        for chain in &best {
            match alike.iter_mut().find(|others| names(others[0]) == names(chain)) {
                Some(others) => others.push(chain),
                None => alike.push(vec![chain]),
            }
        }
        if alike.len() > 1 {
            let ends: Vec<&Chain> = alike.iter().map(|alike| self.end(alike).0).collect();
            return Err(self.tie(&ends, bases.len() > 1));
        }
        let (chosen, why) = self.end(&best);
        if self.sources.base.is_none() {
            guesses.push(self.of_base(&first.base));
        }
        guesses.push(Guess::new(format!("tip: `{}`, {why}", chosen.tip())).or("tip", "--tip names another"));
        let beside = self.beside(chosen)?;
        if !beside.is_empty() {
            let passed = beside.iter().map(|joint| format!("`{}`", joint.name)).collect::<Vec<_>>().join(", ");
            let tip = beside.last().map_or("", |joint| joint.child);
            let said = format!("not on that chain, though they have columns: {passed}");
            guesses.push(
                Guess::new(said).or("tip", format!("if what was measured is there, --tip {tip}, say{}", self.each())),
            );
        }
        Ok(chosen.clone())
    }

    /// The chain to take among those with the same joints, shortest first, and the reason.
    fn end<'c>(&self, alike: &[&'c Chain]) -> (&'c Chain, &'static str) {
        let leaves: Vec<&str> = self.urdf.leaves().collect();
        let at_end: Vec<&&Chain> = alike.iter().filter(|chain| leaves.contains(&chain.tip())).collect();
        match at_end.as_slice() {
            [only] => (**only, "the end of the longest chain whose joints all have columns"),
            [] => (alike[0], "behind the last joint that has a column; what hangs on it moves by others"),
            _ => (alike[0], "behind the last joint that has a column; several links hang on it"),
        }
    }

    fn of_base(&self, base: &str) -> Guess {
        let others: Vec<String> =
            self.urdf.roots().filter(|root| *root != base).map(|root| format!("`{root}`")).collect();
        let said = match others.is_empty() {
            true => format!("base: `{base}`, the link that hangs on nothing"),
            false => format!("base: `{base}`, which hangs on nothing, as {} do", others.join(", ")),
        };
        Guess::new(said).or("base", "--base names another")
    }

    /// The error that chains move by different joints, equally many.
    fn tie(&self, ends: &[&Chain], of_bases: bool) -> InitError {
        let of = |chain: &&Chain| {
            let base = if of_bases { format!("from `{}` ", chain.base) } else { String::new() };
            format!("{base}to `{}` by {}", chain.tip(), names(chain).join(", "))
        };
        let option = |chain: &&Chain| {
            let base = if of_bases { format!("--base {} ", chain.base) } else { String::new() };
            format!("{base}--tip {}", chain.tip())
        };
        let mut options: Vec<String> = ends.iter().map(option).collect();
        options.extend(Self::parting(ends).map(|link| format!("--tip {link}, where they part")));
        InitError::Misfit {
            what: format!(
                "{} chains move by as many joints that {} has columns for: {}",
                ends.len(),
                self.sources.table_file,
                ends.iter().map(of).collect::<Vec<_>>().join("; ")
            ),
            hint: format!("say which carries what was measured: {}{}", options.join(" or "), self.each()),
        }
    }

    /// What to do besides where several things were measured, or cameras may be carried.
    fn each(&self) -> String {
        match carried(self.urdf, self.titles).as_slice() {
            [] | [_] => String::new(),
            names => format!("; or of each of {} by itself: --on NAME=LINK", names.join(", ")),
        }
    }

    /// The last link that chains have in common, if most joints come before it: for example the hand that carries two
    /// fingers.
    fn parting(ends: &[&Chain]) -> Option<String> {
        let (first, others) = ends.split_first()?;
        let is_shared = |name: &String| others.iter().all(|other| other.segments.iter().any(|it| it.name == *name));
        let shared: Vec<_> = first.segments.iter().take_while(|segment| is_shared(&segment.name)).collect();
        let moving = shared.iter().filter(|segment| segment.kind.moves().is_some()).count();
        (2 * moving > first.moving().count()).then_some(())?;
        Some(shared.last()?.link.clone())
    }

    /// The joints beside a chain that have columns. One behind it would have made the chain longer, so something is
    /// wrong with it.
    fn beside(&self, chosen: &Chain) -> Result<Vec<JointEnds<'_>>, InitError> {
        let on_chain: Vec<&str> = chosen.segments.iter().map(|segment| segment.name.as_str()).collect();
        let is_reading = |joint: &JointEnds| chosen.readings.iter().any(|reading| reading.name == joint.name);
        let last = chosen.moving().last().map_or("", |segment| segment.name.as_str());
        let mut beside = Vec::new();
        for joint in self.with_columns().filter(|joint| !on_chain.contains(&joint.name) && !is_reading(joint)) {
            let is_behind = self.urdf.carriers(joint.child).iter().any(|carrier| carrier.name == last);
            // One that follows another has no part of its own.
            if !is_behind || joint.mimics().is_some() {
                beside.push(joint);
                continue;
            }
            let chain = self.urdf.chain(&chosen.base, joint.child);
            let chain = chain.map_err(|error| self.refused(&chosen.base, joint.child, error))?;
            let missing = self.without_column(&chain);
            return Err(InitError::Misfit {
                what: format!(
                    "{} has a column for joint `{}` and none for {}, on which it hangs; its columns are {}",
                    self.sources.table_file,
                    joint.name,
                    missing.join(", "),
                    self.titles.join(", ")
                ),
                hint: format!("title a column with each joint's name, or end the chain before: --tip {}", chosen.tip()),
            });
        }
        Ok(beside)
    }

    /// The error that no chain moves by joints that have columns.
    fn none_fits(&self, bases: &[&str]) -> InitError {
        let below = |joint: &JointEnds| {
            let carriers = self.urdf.carriers(joint.child);
            let base = bases.iter().find(|base| carriers.iter().any(|carrier| carrier.parent == **base));
            let base = base.or(bases.first()).copied().unwrap_or_default();
            let covered = carriers.iter().filter(|carrier| self.has_column(carrier)).count();
            (covered, base.to_owned())
        };
        // Where the most joints have columns, the first there.
        let mut most: Option<(usize, String, JointEnds)> = None;
        for joint in self.with_columns() {
            let (covered, base) = below(&joint);
            if most.as_ref().is_none_or(|(most, ..)| covered > *most) {
                most = Some((covered, base, joint));
            }
        }
        let table = self.sources.table_file;
        let Some((_, base, joint)) = most else {
            let (what, hint) = self.no_title(bases);
            return InitError::Misfit { what, hint };
        };
        match self.urdf.chain(&base, joint.child) {
            Err(error) => self.refused(&base, joint.child, error),
            Ok(chain) => InitError::Misfit {
                what: format!(
                    "{table} has a column for joint `{}` and none for {}, by which it moves too; its columns are {}",
                    joint.name,
                    self.without_column(&chain).join(", "),
                    self.titles.join(", ")
                ),
                hint: format!("{}{}", self.behind_missing(&chain), self.each()),
            },
        }
    }

    /// The advice for a chain with joints without columns: those before all others may have stood still.
    fn behind_missing(&self, chain: &Chain) -> String {
        let hint = "title a column with each joint's name (`_deg` and `_mm` at its end say the unit)";
        let missing = self.without_column(chain);
        let is_missing = |name: &str| missing.contains(&name);
        let reading = |follows: &Follows| follows.readings().any(|one| is_missing(&chain.readings[one].name));
        let lacks: Vec<bool> =
            chain.segments.iter().map(|segment| segment.follows.as_ref().is_some_and(reading)).collect();
        let moves = chain.segments.iter().map(|segment| segment.kind.moves().is_some());
        let first = moves.zip(&lacks).position(|(moves, lacks)| moves && !lacks);
        match (first, lacks.iter().rposition(|lacks| *lacks)) {
            (Some(first), Some(last)) if last < first => {
                format!(
                    "{hint}, or, if it stood still, begin the chain behind it: --base {}",
                    chain.segments[last].link
                )
            }
            _ => hint.to_owned(),
        }
    }

    /// The message for a table in which no title is a joint's name.
    fn no_title(&self, bases: &[&str]) -> (String, String) {
        let file = self.sources.table_file;
        let what = format!(
            "no column of {file} is titled with the name of a joint; its columns are {}",
            self.titles.join(", ")
        );
        let (mut joints, mut others) = (Vec::new(), Vec::new());
        for joint in self.urdf.joints() {
            match joint.moves() {
                Ok(Some(_)) if joint.mimics().is_some() => others.push(format!("`{}` follows another", joint.name)),
                Ok(Some(_)) => joints.push(joint.name),
                Ok(None) => {}
                Err(error) => others.push(format!("line {}: {}", error.line, error.what)),
            }
        }
        if joints.is_empty() && others.is_empty() {
            return (
                what,
                format!("give a description with joints that move: behind `{}` there is none", bases.join("`, `")),
            );
        }
        let mut hint = match joints.is_empty() {
            true => "no joint of the description can be taken".to_owned(),
            false => format!("title columns with the joints' names: {}", joints.join(", ")),
        };
        if !others.is_empty() {
            hint.push_str(&format!("; not to be taken: {}", others.join(", ")));
        }
        (what, hint)
    }

    /// The error that there is no chain: with advice on a joint that floats, by name.
    pub fn refused(&self, base: &str, link: &str, error: UrdfError) -> InitError {
        let carriers = self.urdf.carriers(link);
        let to_base = carriers.iter().position(|carrier| carrier.parent == base).map_or(0, |last| last + 1);
        let floating = carriers[..to_base].iter().find(|carrier| ["floating", "planar"].contains(&carrier.kind));
        match floating {
            Some(JointEnds { name, parent, child, kind, .. }) if *child != link => InitError::Misfit {
                what: format!(
                    "{}: joint `{name}` between `{parent}` and `{child}` is {kind}, and no one reading says where it is",
                    self.sources.urdf_file
                ),
                hint: format!("begin the chain behind it: --base {child}"),
            },
            _ => InitError::Urdf { file: self.sources.urdf_file.to_owned(), source: error },
        }
    }

    /// The names of a chain's readings without a column.
    fn without_column<'c>(&self, chain: &'c Chain) -> Vec<&'c str> {
        let readings = chain.readings.iter();
        let missing = readings.filter(|reading| columns::of_joint(self.titles, &reading.name, reading.kind).is_none());
        missing.map(|reading| reading.name.as_str()).collect()
    }

    /// The joints with columns that are not among those of a chain, nor what one of these follows.
    pub fn columns_beside<'c>(&'c self, chain: &'c Chain) -> impl Iterator<Item = &'c str> {
        let is_in = |name: &str| {
            chain.segments.iter().any(|segment| segment.name == name)
                || chain.readings.iter().any(|reading| reading.name == name)
        };
        self.with_columns().map(|joint| joint.name).filter(move |name| !is_in(name))
    }

    /// The joints with columns that could move.
    fn with_columns(&self) -> impl Iterator<Item = JointEnds<'_>> {
        self.urdf.joints().filter(|joint| joint.kind != "fixed" && self.has_column(joint))
    }

    fn has_column(&self, joint: &JointEnds) -> bool {
        column(self.titles, joint).is_some()
    }
}

/// The names of a chain's readings.
fn names(chain: &Chain) -> Vec<&str> {
    chain.readings.iter().map(|reading| reading.name.as_str()).collect()
}
