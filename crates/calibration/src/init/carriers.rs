//! The links that carry targets and cameras, where a table tells: by their names, or as somebody says.

use body_schema_robot::{Chain, Urdf};

use super::{
    Guess, InitError, Sources,
    chain::ChainSearch,
    columns::Measured,
    named::{BALL, Carried, FRAMES, names},
};

/// All targets and cameras, in the order of the table's columns.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Carriers(Vec<Carried>);

/// What is called so where titles have no name for it: links of these names may be something else.
const UNNAMED: [&str; 3] = ["camera", "marker", BALL];

impl Carriers {
    /// Those that `measured` names, each on the link that [`Sources::on`] says or on the one that is called as it is; targets only by what
    /// is said where [`Sources::tip`] says where they are. What titles have no name for is only where it is said to be.
    ///
    /// # Errors
    ///
    /// [`InitError::Misfit`] if something is said of what is not measured, or of a link that there is not.
    pub fn found(sources: &Sources<'_>, urdf: &Urdf, measured: &Measured) -> Result<Self, InitError> {
        let all = names(measured);
        let has = |link: &str| urdf.links().iter().any(|known| known == link);
        for (name, link) in sources.on {
            let misfit = |what: String, hint: String| InitError::Misfit { what, hint };
            if !all.iter().any(|(carried, group)| carried.name == *name || group == name) {
                let mut known: Vec<&str> =
                    all.iter().flat_map(|(carried, group)| [group, carried.name.as_str()]).collect();
                known.dedup();
                let what = format!(
                    "{} has no target or camera `{name}`, whose link is said to be `{link}`",
                    sources.table_file
                );
                return Err(misfit(what, format!("name one of {}", known.join(", "))));
            }
            if !has(link) {
                let what = format!("{} has no link `{link}`, which is said to carry `{name}`", sources.urdf_file);
                return Err(misfit(what, format!("name one of its links: {}", urdf.links().join(", "))));
            }
        }
        let carried = all.into_iter().map(|(mut carried, group)| {
            let said = sources.on.iter().rfind(|(name, _)| *name == carried.name || name == group);
            let frames = if carried.is_camera { &FRAMES[..] } else { &FRAMES[1..2] };
            let called = || {
                let called = [carried.name.as_str(), group];
                let mut links =
                    called.into_iter().flat_map(|name| frames.iter().map(move |frame| format!("{name}{frame}")));
                let is_named = !UNNAMED.contains(&group);
                links.find(|link| is_named && (carried.is_camera || sources.tip.is_none()) && has(link))
            };
            carried.is_said = said.is_some();
            carried.link = said.map(|(_, link)| link.clone()).or_else(called);
            carried
        });
        Ok(Self(carried.collect()))
    }

    /// Whether nothing is known of any.
    pub fn is_empty(&self) -> bool {
        self.0.iter().all(|carried| carried.link.is_none())
    }

    /// The link of a target or a camera.
    pub fn link(&self, name: &str, is_camera: bool) -> Option<&str> {
        self.0.iter().find(|it| it.name == name && it.is_camera == is_camera)?.link.as_deref()
    }

    /// Where a camera is on its link and how it looks, `rpy_deg`: along z of an optical frame, along x of another link of its name;
    /// `None` beside the robot, and on a link that tells nothing of it.
    pub fn looks(&self, camera: &str) -> Option<[f64; 3]> {
        let carried = self.0.iter().find(|it| it.name == camera && it.is_camera)?;
        let link = carried.link.as_ref()?;
        let along_x = (!carried.is_said).then_some([-90.0, 0.0, -90.0]);
        if looks_along_z(link) { Some([0.0; 3]) } else { along_x }
    }

    /// The links, each once.
    fn links(&self) -> Vec<&str> {
        let mut links: Vec<&str> = Vec::new();
        for link in self.0.iter().filter_map(|carried| carried.link.as_deref()) {
            if !links.contains(&link) {
                links.push(link);
            }
        }
        links
    }

    /// The joints that move what is measured, of which `search` finds the links that nothing says; what was guessed is added to `guesses`.
    ///
    /// # Errors
    ///
    /// [`InitError`] if links do not hang on one base, or joints between them have no column.
    pub fn joints(
        &mut self,
        search: &ChainSearch<'_>,
        measured: &Measured,
        guesses: &mut Vec<Guess>,
    ) -> Result<Chain, InitError> {
        let ChainSearch { sources, urdf, .. } = search;
        for Carried { name, is_camera, link, is_said } in &self.0 {
            let what = if *is_camera { "camera" } else { "target" };
            if let Some(link) = link.as_ref().filter(|_| !is_said) {
                guesses.push(otherwise(name, format!("{what} `{name}`: on link `{link}`, by its name")));
            }
            if let Some(link) = link.as_ref().filter(|link| *is_camera && !is_said && !looks_along_z(link)) {
                guesses.push(Guess::new(format!(
                    "camera `{name}`: it looks along x of link `{link}`, z being up, as links do that are not optical frames; if it looks \
                     along z, write rpy_deg = [0.0, 0.0, 0.0]"
                )));
            }
        }
        if self.0.iter().any(|carried| !carried.is_camera && carried.link.is_none()) {
            self.place(search, guesses)?;
        }
        // Seen from outside, everything moves by all joints behind the root.
        let is_carried =
            |camera: &Option<String>| camera.as_ref().is_some_and(|camera| self.link(camera, true).is_some());
        let outside = measured.sensors.iter().any(|sensor| !is_carried(&sensor.camera));
        let links = self.links();
        let root = links.first().and_then(|link| urdf.carriers(link).last().map(|joint| joint.parent)).or(urdf.root());
        let apart = urdf.ancestor(&links).filter(|link| !outside && !links.contains(link));
        let base = sources.base.or(apart).or(root).unwrap_or_default().to_owned();
        if sources.base.is_none() {
            let why = if apart.is_some() {
                "the last link that carries all of that"
            } else {
                "the link that hangs on nothing"
            };
            guesses.push(Guess::new(format!("base: `{base}`, {why}")).or("base", "--base names another"));
        }
        let ends: Vec<&str> = links.into_iter().filter(|link| *link != base).collect();
        let chain = urdf
            .branches(&base, &ends)
            .map_err(|error| search.refused(&base, ends.first().copied().unwrap_or_default(), error))?;
        // What moves everything alike needs no column.
        let between = apart.and_then(|apart| urdf.branches(apart, &ends).ok());
        search.complete(between.as_ref().unwrap_or(&chain))?;
        let unused: Vec<&str> = search.columns_beside(&chain).collect();
        if !unused.is_empty() {
            guesses
                .push(Guess::new(format!("not between these links, though they have columns: {}", unused.join(", "))));
        }
        Ok(chain)
    }

    /// Finds where targets are of which nothing says it: on the tip of the longest chain, or beside the robot, if a camera is there.
    fn place(&mut self, search: &ChainSearch<'_>, guesses: &mut Vec<Guess>) -> Result<(), InitError> {
        let mut said = Vec::new();
        // What moves a camera and its target alike need have no column.
        let camera = self.0.iter().find_map(|carried| carried.link.as_deref().filter(|_| carried.is_camera));
        let on_its_way = camera.filter(|_| search.sources.base.is_none() && search.sources.tip.is_none());
        let chain = match on_its_way {
            Some(camera) => {
                let mut bases = vec![camera];
                bases.extend(search.urdf.carriers(camera).into_iter().map(|joint| joint.parent));
                search.longest(&bases, &mut said)?
            }
            None => search.chain(&mut said)?,
        };
        let on = |link: &str| search.urdf.fixed_on(&chain, link).map(|(body, _)| body);
        let rides = self.0.iter().find(|carried| {
            let body = carried.link.as_deref().filter(|_| carried.is_camera).and_then(on);
            body.is_some() && body == on(chain.tip())
        });
        let (link, why) = match rides.filter(|_| search.sources.tip.is_none()) {
            Some(camera) => (chain.base.clone(), format!("it stands still, and camera `{}` moves", camera.name)),
            None => (chain.tip().to_owned(), "the end of the longest chain whose joints all have columns".to_owned()),
        };
        for carried in self.0.iter_mut().filter(|carried| !carried.is_camera && carried.link.is_none()) {
            guesses.push(otherwise(&carried.name, format!("target `{}`: on link `{link}`, {why}", carried.name)));
            carried.link = Some(link.clone());
        }
        Ok(())
    }
}

/// Whether a link is a camera's optical frame: z ahead, x to the right of the picture, y down.
fn looks_along_z(link: &str) -> bool {
    link.contains("optical")
}

fn otherwise(name: &str, said: String) -> Guess {
    Guess { option: Some(format!("--on {name}=LINK says another")), ..Guess::new(said) }
}
