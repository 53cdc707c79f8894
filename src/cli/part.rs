//! A part of a comparison: the runs of some of its seeds, in a file that `merge` puts together with the others.
//!
//! It is compressed JSON, a line each: what the comparison is, then one run after the other, in the order in which they ended.

use std::{
    collections::BTreeSet,
    fs::File,
    io::{BufRead, BufReader, Write},
    path::{Path, PathBuf},
    str::FromStr,
};

use anyhow::{Context, Result};
use body_schema_files::AtomicFile;
use body_schema_table::Guard;
use body_schema_wire::{Comparison, Trace};
use flate2::{Compression, bufread::GzDecoder, write::GzEncoder};
use serde::{Deserialize, Serialize};

use super::{BadInput, output, seeds::MOST as MOST_SEEDS};

/// The version of the form of these files.
const FORM: u32 = 1;
/// The most parts: one for each seed.
const MOST_PARTS: u64 = MOST_SEEDS;
/// The most bytes of a part, unpacked, and of all parts together: they are held in memory.
const MOST_BYTES: u64 = 256 << 20;
const MOST_BYTES_OF_ALL: u64 = 4 << 30;
/// The most missing parts that are named.
const NAMED: usize = 12;

/// One of so many parts, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    index: u64,
    of: u64,
}

impl Shard {
    fn is_sound(self) -> bool {
        (1..=self.of.min(MOST_PARTS)).contains(&self.index)
    }

    /// The seeds of this part: dealt out one by one, so that all parts take about as long.
    pub fn of(self, seeds: impl Iterator<Item = u64>) -> Vec<u64> {
        let mine = |place: u64| place % self.of == self.index - 1;
        (0..).zip(seeds).filter(|(place, _)| mine(*place)).map(|(_, seed)| seed).collect()
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        let (index, of) = numbers.ok_or("write the part and how many there are, as 1/4")?;
        let shard = Self { index, of };
        if of > MOST_PARTS {
            Err(format!("there are at most {MOST_PARTS} parts"))
        } else if shard.is_sound() {
            Ok(shard)
        } else {
            Err(format!("parts are counted from 1 to {of}"))
        }
    }
}

/// The comparison that a part belongs to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct About {
    form: u32,
    /// The version of body-schema: another may compute other runs.
    version: String,
    /// The name of the scenario, and its file, which must be the same for all parts.
    scenario: String,
    source: String,
    learners: Vec<String>,
    steps: u64,
    /// All seeds of the comparison, the first and the last.
    seeds: [u64; 2],
    shard: Shard,
}

impl About {
    pub fn new(scenario: (&str, &str), learners: Vec<String>, steps: u64, seeds: [u64; 2], shard: Shard) -> Self {
        let (version, (scenario, source)) = (env!("CARGO_PKG_VERSION").to_owned(), scenario);
        let (scenario, source) = (scenario.to_owned(), source.to_owned());
        Self { form: FORM, version, scenario, source, learners, steps, seeds, shard }
    }

    /// The reason why this part and another do not belong to one comparison; `None` if they do.
    fn differs_from(&self, other: &Self) -> Option<&'static str> {
        let alike = [
            (self.version == other.version, "another version of body-schema wrote it"),
            (self.scenario == other.scenario, "it is of another scenario"),
            (self.source == other.source, "its scenario file was another"),
            (self.learners == other.learners, "it is of other learners"),
            (self.steps == other.steps, "its runs have another number of movements"),
            (self.seeds == other.seeds, "it is of other --seeds"),
            (self.shard.of == other.shard.of, "it is one of another number of parts"),
        ];
        alike.into_iter().find(|(same, _)| !same).map(|(_, why)| why)
    }
}

/// A part that is being written. It gets its name only once it is whole.
pub struct Writer {
    path: PathBuf,
    whole: AtomicFile,
    lines: GzEncoder<File>,
}

impl Writer {
    pub fn begin(path: &Path, about: &About) -> Result<Self> {
        let (file, whole) = AtomicFile::create(path).with_context(|| output::cannot(path))?;
        let lines = GzEncoder::new(file, Compression::default());
        let mut writer = Self { path: path.to_owned(), whole, lines };
        writer.line(about)?;
        Ok(writer)
    }

    pub fn run(&mut self, trace: &Trace) -> Result<()> {
        self.line(trace)
    }

    pub fn end(self) -> Result<()> {
        let Self { path, whole, lines } = self;
        lines.finish().and_then(|_| whole.commit()).with_context(|| output::cannot(&path))
    }

    fn line(&mut self, value: &impl Serialize) -> Result<()> {
        let text = serde_json::to_string(value)?;
        writeln!(self.lines, "{text}").with_context(|| output::cannot(&self.path))
    }
}

/// Merges parts into what one run over all seeds would have given.
pub fn merged(paths: &[PathBuf]) -> Result<Comparison> {
    let refuse = |path: &Path, why: &str| BadInput(format!("{}: {why}", path.display()));
    let (mut all, mut traces): (Vec<(About, &Path)>, Vec<Trace>) = (Vec::new(), Vec::new());
    let mut left = MOST_BYTES_OF_ALL;
    for path in paths {
        let (about, runs) = read(path, &mut left)?;
        if let Some((first, place)) = all.first()
            && let Some(why) = about.differs_from(first)
        {
            let why = format!("{why} than {}; name the parts of one comparison", place.display());
            return Err(refuse(path, &why).into());
        }
        if let Some((_, twin)) = all.iter().find(|(other, _)| other.shard == about.shard) {
            let Shard { index, of } = about.shard;
            let why = format!("it is part {index}/{of}, as is {}; name each part once", twin.display());
            return Err(refuse(path, &why).into());
        }
        let wanted: BTreeSet<u64> = about.shard.of(about.seeds[0]..=about.seeds[1]).into_iter().collect();
        let found: BTreeSet<u64> = runs.iter().map(Trace::seed).collect();
        let is_whole = found == wanted && runs.len() == wanted.len();
        if !is_whole || !runs.iter().all(|run| run.is_of(&about.learners, about.steps)) {
            return Err(refuse(path, "its runs are not those that it promises; compute it again").into());
        }
        traces.extend(runs);
        all.push((about, path));
    }
    let Some((about, _)) = all.first() else { return Err(BadInput("name the parts to merge".to_owned()).into()) };
    let there: BTreeSet<u64> = all.iter().map(|(about, _)| about.shard.index).collect();
    let missing: Vec<String> = (1..=about.shard.of)
        .filter(|index| !there.contains(index))
        .map(|index| format!("{index}/{}", about.shard.of))
        .collect();
    if !missing.is_empty() {
        let (named, more) = (&missing[..missing.len().min(NAMED)], if missing.len() > NAMED { ", …" } else { "" });
        return Err(BadInput(format!("parts are missing: {}{more}; name them too", named.join(", "))).into());
    }
    traces.sort_by_key(Trace::seed);
    Ok(Comparison::of(&about.scenario, about.steps, &traces))
}

/// Reads a part, and deducts its size from the bytes that are left for all.
fn read(path: &Path, left: &mut u64) -> Result<(About, Vec<Trace>)> {
    let name = path.display();
    let file = File::open(path).with_context(|| format!("cannot read {name}"))?;
    let no_part =
        |why: String| BadInput(format!("{name} is no part of a comparison, or not whole: {why}; compute it again"));
    let too_long = |what: &str, most: u64| {
        BadInput(format!("{name}: {what} than {} MiB of parts, the most that are read; merge fewer runs", most >> 20))
    };
    // What is packed is no longer than what comes of it.
    if file.metadata().is_ok_and(|found| found.len() > MOST_BYTES) {
        return Err(too_long("it is longer", MOST_BYTES).into());
    }
    let unpacked = Guard::new(GzDecoder::new(BufReader::new(file)), MOST_BYTES);
    let mut lines = BufReader::new(unpacked).lines();
    let first =
        lines.next().ok_or_else(|| no_part("it is empty".to_owned()))?.map_err(|error| no_part(error.to_string()))?;
    #[derive(Deserialize)]
    struct Form {
        form: u32,
    }
    let Form { form } = serde_json::from_str(&first).map_err(|error| no_part(error.to_string()))?;
    if form > FORM {
        return Err(
            BadInput(format!("{name} has form {form}, and this program knows {FORM}; update body-schema")).into()
        );
    }
    let about: About = serde_json::from_str(&first).map_err(|error| no_part(error.to_string()))?;
    let [first, last] = about.seeds;
    if !about.shard.is_sound() || first > last || last - first >= MOST_SEEDS {
        return Err(no_part("its numbers fit nothing".to_owned()).into());
    }
    let parsed = |line: std::io::Result<String>| -> Result<Trace, BadInput> {
        let line = line.map_err(|error| no_part(error.to_string()))?;
        *left =
            left.checked_sub(line.len() as u64).ok_or_else(|| too_long("with it there is more", MOST_BYTES_OF_ALL))?;
        serde_json::from_str(&line).map_err(|error| no_part(error.to_string()))
    };
    let traces = lines.map(parsed).collect::<Result<_, _>>()?;
    Ok((about, traces))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_seed_is_dealt_to_one_part() {
        let parts = ["1/3", "2/3", "3/3"].map(|text| text.parse::<Shard>().expect("a part").of(5..=11));
        assert_eq!(parts, [vec![5, 8, 11], vec![6, 9], vec![7, 10]]);
        for wrong in ["0/3", "4/3", "1", "a/b", "1/0", "-1/2", "1/10000000000"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
