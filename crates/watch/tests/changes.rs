//! What a watch finds on a TIAGo as it is calibrated, seed by seed; `examples/years.rs` measures it at length.

use std::{path::Path, sync::OnceLock};

use body_schema_calibration::Case;
use body_schema_engine::{
    model::{Block, Layout, State},
    sensing::Observation,
};
use body_schema_scenario::{Scenario, builtin};
use body_schema_watch::{Body, Covariate, Event, Kind, Known, Settings, Sighting, Skipped, Suspect, Watch, WatchError};
use nalgebra::{Cholesky, DMatrix, DVector, Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

const WEEK: f64 = 1.0 / 52.0;

struct World {
    body: Body,
    postures: Vec<Vec<f64>>,
    root: DMatrix<f64>,
}

fn world() -> &'static World {
    static WORLD: OnceLock<World> = OnceLock::new();
    WORLD.get_or_init(|| {
        let scenario = builtin("tiago-mocap").expect("built in");
        let case = Case::new(&scenario).expect("measured");
        let split = case.splits(None).expect("a split").remove(0);
        let (fit, widened) = case.standing(&split.training).expect("a fit");
        assert!(widened > 1.0, "{widened}");
        // The noise and the covariance as stated: what is simulated is as they say.
        let body = Body::new(&fit.belief, case.names.clone(), 1.0).expect("a covariance");
        let root = Cholesky::new(body.covariance.clone()).expect("positive").l();
        World { body, postures: case.rows.iter().map(|row| row.positions.clone()).collect(), root }
    })
}

/// A robot that is watched.
struct Robot {
    truth: State,
    watch: Watch,
    rng: ChaCha8Rng,
    /// The postures that it takes in turn; none for drawn ones.
    postures: Vec<Vec<f64>>,
    /// What is measured beside what any model says, at each of these postures.
    beside: Vec<Vector3<f64>>,
    weeks: usize,
    /// The noise of sightings, as a share of what the calibration found.
    noise: f64,
}

impl Robot {
    fn new(seed: u64, settings: Settings) -> Self {
        let (world, mut rng) = (world(), ChaCha8Rng::seed_from_u64(seed));
        let normal = DVector::from_fn(world.root.nrows(), |_, _| rng.sample::<f64, _>(StandardNormal));
        let truth = world.body.state.retract(&world.body.learned, &(&world.root * normal));
        let watch = Watch::new(world.body.clone(), settings).expect("settings");
        Self { truth, watch, rng, postures: Vec::new(), beside: Vec::new(), weeks: 0, noise: 1.0 }
    }

    fn plain(seed: u64) -> Self {
        Self::new(seed, plain())
    }

    fn posture(&mut self) -> Vec<f64> {
        if let Some(posture) = self.postures.get(self.weeks % self.postures.len().max(1)) {
            return posture.clone();
        }
        let postures = &world().postures;
        let of = postures[self.rng.random_range(0..postures.len())].clone();
        of.into_iter().map(|q| q + self.rng.random_range(-0.02..0.02)).collect()
    }

    fn see(&mut self) -> (Vec<f64>, Observation) {
        let posture = self.posture();
        let noise: Vec<f64> = (0..3).map(|_| self.noise * self.rng.sample::<f64, _>(StandardNormal)).collect();
        let mut seen = self.watch.body().measurement_model.observe(&self.truth, &posture, &noise);
        if let (Some(beside), Some(reading)) =
            (self.beside.get(self.weeks % self.beside.len().max(1)), &mut seen.readings[0])
        {
            reading.iter_mut().zip(beside.iter()).for_each(|(x, by)| *x += by);
        }
        self.weeks += 1;
        (posture, seen)
    }

    fn hear(&mut self, posture: &[f64], seen: &Observation, covariate: Option<f64>) -> Option<Event> {
        let sighting = Sighting { elapsed_years: WEEK, positions: posture, observation: seen, covariate };
        self.watch.hear(&sighting).expect("seen").event
    }

    /// The first event within so many weeks, and the week.
    fn within(&mut self, weeks: usize) -> Option<(usize, Event)> {
        (1..=weeks).find_map(|week| {
            let (posture, seen) = self.see();
            Some((week, self.hear(&posture, &seen, None)?))
        })
    }

    fn off(&mut self, block: Block, by: &[f64]) {
        let layout = Layout::new(&self.truth, [block]);
        self.truth = self.truth.retract(&layout, &DVector::from_column_slice(by));
    }
}

fn plain() -> Settings {
    Settings { shares: vec![0.0], ..Settings::default() }
}

/// Of 12 robots those whose first joints' zeros go off by a degree: found within six weeks, named, and as large as it is.
#[test]
fn a_zero_that_is_off_is_found_and_named() {
    let (mut found, mut named, mut near, mut all) = (0, 0, 0, 0);
    for seed in 1..=4 {
        let mut robot = Robot::plain(seed);
        robot.within(15);
        for joint in [1, 2, 4] {
            let mut robot = robot_of(&robot);
            let by = if seed % 2 == 0 { 1_f64 } else { -1.0 };
            robot.off(Block::Offset(joint), &[by.to_radians()]);
            all += 1;
            let Some((_, event)) = robot.within(6) else { continue };
            found += 1;
            let first = &event.explanations[0];
            named += usize::from(first.suspect == Suspect::Zero(joint));
            near += usize::from((first.amounts[0].value - by).abs() < 3.0 * first.amounts[0].sd.max(0.05));
            assert_eq!(event.kind, Kind::Alarm);
        }
    }
    assert!(
        all == 12 && found >= 11 && named >= 10 && near >= 10,
        "{found} found, {named} named, {near} near of {all}"
    );
}

fn robot_of(robot: &Robot) -> Robot {
    Robot {
        truth: robot.truth.clone(),
        watch: robot.watch.clone(),
        rng: robot.rng.clone(),
        postures: robot.postures.clone(),
        beside: robot.beside.clone(),
        weeks: robot.weeks,
        noise: robot.noise,
    }
}

/// A tripod that was bumped, a link that was bent, a marker that was knocked: none is called a joint's zero.
#[test]
fn what_is_no_zero_is_not_called_one() {
    let mut rightly = 0;
    for seed in 11..=14 {
        let mut robot = Robot::plain(seed);
        robot.within(10);
        let mut tripod = robot_of(&robot);
        tripod.off(Block::Base, &[0.012, -0.008, 0.01, 0.004, 0.006, -0.005]);
        let mut marker = robot_of(&robot);
        marker.off(Block::Target(0), &[0.009, -0.007, 0.008]);
        let mut link = robot_of(&robot);
        let pivot = link.truth.joints[2].line().expect("turns").point;
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.006, 0.012, -0.010));
        let motion: Isometry3<f64> = Translation3::new(0.006, 0.002, -0.006)
            * (Translation3::from(pivot.coords) * turn * Translation3::from(-pivot.coords));
        link.truth = link.truth.carried(&motion, |it| it > 2);
        for (robot, wanted) in
            [(&mut tripod, Suspect::Base), (&mut marker, Suspect::Target(0)), (&mut link, Suspect::Link(2))]
        {
            let Some((_, event)) = robot.within(10) else { continue };
            // Later sightings tell more.
            robot.within(6);
            let found = robot.watch.explanations();
            let first = found.first().or(event.explanations.first()).expect("an explanation");
            // Of a link its motion is told, and zeros and places stay.
            let mended = robot.watch.mended().expect("numbers");
            let is_moved = matches!(robot.watch.explanations().first().map(|it| it.suspect), Some(Suspect::Link(_)));
            assert_eq!(is_moved, !mended.links.is_empty(), "{found:?}");
            let is_link = matches!((wanted, first.suspect), (Suspect::Link(_), Suspect::Link(_)));
            rightly += usize::from(first.suspect == wanted || is_link);
        }
    }
    assert!(rightly >= 10, "{rightly} of 12");
}

/// Single wild sightings, one in twenty: no alarm.
#[test]
fn wild_sightings_raise_no_alarm() {
    let mut alarms = 0;
    for seed in 21..=24 {
        let mut robot = Robot::plain(seed);
        for week in 0..60 {
            let (posture, mut seen) = robot.see();
            if week % 20 == 15 {
                let far = [0.02, 0.3, -9999.0][week / 20];
                seen.readings[0].as_mut().expect("seen")[week % 3] += far;
            }
            let event = robot.hear(&posture, &seen, None);
            alarms += usize::from(event.is_some_and(|event| event.kind == Kind::Alarm));
        }
    }
    // Two are to be expected at most, by the rate that is asked for.
    assert!(alarms <= 1, "{alarms}");
}

/// A tool that is a hand longer, a tripod that was carried elsewhere, a joint that lost its homing, millimetres in place of metres, noise: no
/// small change explains them, and each sighting alone might be wild. It is told within six, and so is the way back.
#[test]
fn what_nothing_explains_is_told() {
    type Spoil = fn(&mut Robot);
    let kinds: [Spoil; 4] = [
        |robot| robot.off(Block::Target(0), &[0.0, 0.0, 0.1]),
        |robot| robot.off(Block::Base, &[0.8, -0.3, 0.0, 0.0, 0.0, 0.4]),
        |robot| robot.off(Block::Offset(2), &[30_f64.to_radians()]),
        |robot| robot.off(Block::Offset(1), &[-70_f64.to_radians()]),
    ];
    for (seed, spoil) in (31..).zip(kinds) {
        for shares in [vec![0.0], Settings::default().shares] {
            let mut robot = Robot::new(seed, Settings { shares, ..Settings::default() });
            assert_eq!(robot.within(12), None, "{seed}");
            let before = robot.truth.clone();
            spoil(&mut robot);
            let (week, event) = robot.within(6).expect("an alarm");
            let first = &event.explanations[0];
            assert_eq!((event.kind, first.suspect), (Kind::Alarm, Suspect::Unlike), "{seed}, week {week}");
            assert_eq!((first.since, first.amounts.len()), (13, 0), "{seed}");
            assert!(robot.watch.is_changed() && robot.watch.mended().is_none());
            robot.truth = before;
            let (_, event) = robot.within(6).expect("a recovery");
            assert_eq!((event.kind, robot.watch.is_changed()), (Kind::Recovered, false), "{seed}");
        }
    }
}

/// Readings in another unit, and such as are anything at all, from the first sighting on.
#[test]
fn readings_that_mean_nothing_are_told() {
    for seed in 41..=44 {
        let mut robot = Robot::new(seed, Settings::default());
        let told = (1..=6).find_map(|_| {
            let (posture, mut seen) = robot.see();
            for x in seen.readings[0].as_mut().expect("seen") {
                *x = if seed % 2 == 0 { *x * 1e3 } else { *x + robot.rng.random_range(-1.0..1.0) };
            }
            robot.hear(&posture, &seen, None)
        });
        let event = told.expect("an alarm");
        assert_eq!(event.explanations[0].suspect, Suspect::Unlike, "{seed}");
        assert!(event.explanations[0].since <= 2, "{seed}");
    }
}

/// Six postures in turn, and three quarters of the noise's variance the same at each of them, always: no alarm where sightings at a posture
/// may share that.
#[test]
fn what_a_posture_shares_is_no_change() {
    let (mut alarms, mut without) = (0, 0);
    for seed in 31..=34 {
        for (settings, count) in [(Settings::default(), &mut alarms), (plain(), &mut without)] {
            let mut robot = Robot::new(seed, settings);
            robot.postures = (0..6).map(|k| world().postures[(7 * k + seed as usize) % 96].clone()).collect();
            robot.noise = 0.5;
            let sigma = robot.watch.body().measurement_model.sigma() * 0.75_f64.sqrt();
            robot.beside =
                (0..6).map(|_| Vector3::from_fn(|_, _| sigma * robot.rng.sample::<f64, _>(StandardNormal))).collect();
            for _ in 0..60 {
                let (posture, seen) = robot.see();
                *count += usize::from(robot.hear(&posture, &seen, None).is_some());
            }
        }
    }
    assert!(alarms <= 1 && without > alarms, "{alarms} alarms, and {without} where nothing is shared");
}

/// A zero that goes with the temperature: an alarm where nobody says so, else a drift that is told.
#[test]
fn a_drift_is_told_from_a_break() {
    let covariate = Some(Covariate { reference: Some(20.0), span: 10.0 });
    for seed in 41..=43 {
        let mut heard = Robot::new(seed, Settings { covariate, ..plain() });
        let mut unheard = Robot::plain(seed);
        let (mut alarms, mut without) = (0, 0);
        for week in 0..60 {
            let celsius = 20.0 + 8.0 * (f64::from(week) * 0.12).sin();
            let by = (0.06 * (celsius - 20.0)).to_radians();
            for (robot, covariate, count) in
                [(&mut heard, Some(celsius), &mut alarms), (&mut unheard, None, &mut without)]
            {
                let truth = robot.truth.clone();
                robot.off(Block::Offset(1), &[by]);
                let (posture, seen) = robot.see();
                robot.truth = truth;
                *count += usize::from(robot.hear(&posture, &seen, covariate).is_some());
            }
        }
        let drifts = heard.watch.drifts();
        assert!(alarms == 0 && without > 0, "seed {seed}: {alarms} and {without}");
        let found = drifts.iter().find(|drift| drift.joint.as_deref() == Some("arm_1_joint")).expect("a drift");
        assert!((found.per_unit - 0.06).abs() < 4.0 * found.sd && found.unit == "deg", "{found:?}");
    }
}

/// What was knocked and put right again is told as such, and what stands after it is nothing.
#[test]
fn a_recovery_is_told() {
    let mut recovered = 0;
    for seed in 51..=54 {
        let mut robot = Robot::plain(seed);
        robot.within(10);
        let sound = robot.truth.clone();
        robot.off(Block::Offset(2), &[1.5_f64.to_radians()]);
        robot.within(8).expect("an alarm");
        for _ in 0..4 {
            let (posture, seen) = robot.see();
            robot.hear(&posture, &seen, None);
        }
        assert!(robot.watch.is_changed());
        robot.truth = sound;
        if robot.within(8).is_some_and(|(_, event)| event.kind == Kind::Recovered) && !robot.watch.is_changed() {
            recovered += 1;
        }
    }
    assert!(recovered >= 3, "{recovered} of 4");
}

/// Two changes stand: both are told, with their sizes; what comes back first is told no more, and the other still is.
#[test]
fn of_two_changes_each_is_told_until_it_comes_back() {
    let (mut both, mut left) = (0, 0);
    for seed in 61..=64 {
        let mut robot = Robot::plain(seed);
        robot.within(10);
        let sound = robot.truth.clone();
        robot.off(Block::Offset(2), &[1.5_f64.to_radians()]);
        robot.within(8).expect("an alarm");
        robot.within(6);
        let one = robot.truth.clone();
        robot.off(Block::Offset(4), &[-2_f64.to_radians()]);
        if robot.within(10).is_none_or(|(_, event)| event.kind != Kind::Alarm) {
            continue;
        }
        robot.within(6);
        let size = |robot: &Robot, joint: usize| {
            let told = robot.watch.explanations();
            let it = told.iter().find(|it| it.suspect == Suspect::Zero(joint) && it.probability > 0.5)?;
            assert!(it.amounts.len() == 1 && it.since > 10, "{it:?}");
            Some(it.amounts[0].value)
        };
        let near = |found: Option<f64>, truly: f64| found.is_some_and(|found| (found - truly).abs() < 0.6);
        both += usize::from(near(size(&robot, 2), 1.5) && near(size(&robot, 4), -2.0));
        // The first is put right.
        robot.truth = sound;
        let offset = one.corrections[2].offset;
        robot.off(Block::Offset(4), &[-2_f64.to_radians()]);
        assert!(offset != robot.truth.corrections[2].offset, "it is as it was");
        let Some((_, event)) = robot.within(10) else { continue };
        let movements = robot.watch.movements(&[], &world().postures).expect("a change stands");
        assert!(movements.leaves.iter().any(|it| !it.amounts.is_empty()), "{movements:?}");
        left += usize::from(event.kind == Kind::Recovered && near(size(&robot, 4), -2.0) && size(&robot, 2).is_none());
    }
    assert!(both >= 3 && left >= 3, "{both} and {left} of 4");
}

/// What has moved moves further: the same zero is named, with all of it.
#[test]
fn what_moves_again_is_named_again() {
    let mut named = 0;
    for seed in 71..=74 {
        let mut robot = Robot::plain(seed);
        robot.within(10);
        robot.off(Block::Offset(2), &[1_f64.to_radians()]);
        robot.within(10).expect("an alarm");
        robot.within(6);
        robot.off(Block::Offset(2), &[1.5_f64.to_radians()]);
        robot.within(10);
        robot.within(6);
        let told = robot.watch.explanations();
        let it = told.iter().find(|it| it.suspect == Suspect::Zero(2) && it.probability > 0.5);
        named += usize::from(it.is_some_and(|it| (it.amounts[0].value - 2.5).abs() < 0.5));
    }
    assert!(named >= 3, "{named} of 4");
}

/// The movements that are named tell more of what has moved than as many that were drawn.
#[test]
fn the_movements_tell_more_than_others() {
    let mut robot = Robot::plain(61);
    robot.within(10);
    robot.off(Block::Offset(2), &[3_f64.to_radians()]);
    robot.within(30).expect("an alarm");
    let sightings: Vec<(Vec<f64>, Observation)> = (0..40).map(|_| robot.see()).collect();
    let known: Vec<Known<'_>> =
        sightings.iter().map(|(positions, observation)| Known { positions, observation }).collect();
    let found = robot.watch.movements(&known, &[]).expect("a change stands");
    assert_eq!((found.positions.len(), found.tells_nats.len()), (3, 3));
    assert!(found.tells_nats.windows(2).all(|pair| pair[0] >= pair[1] - 1e-9), "{found:?}");
    let suspect = robot.watch.explanations()[0].suspect;
    let left = |of: &[Known<'_>]| robot.watch.deviations(suspect, of).expect("a suspect")[0];
    let chosen: Vec<Known<'_>> = found
        .positions
        .iter()
        .map(|place| *known.iter().find(|it| it.positions == place.as_slice()).expect("of these"))
        .collect();
    let mut drawn: Vec<f64> = known.chunks(3).map(left).collect();
    drawn.sort_by(f64::total_cmp);
    assert!(left(&chosen) < drawn[drawn.len() / 2], "{} and {drawn:?}", left(&chosen));
    let now = robot.watch.explanations()[0].amounts[0].sd;
    assert!(found.leaves[0].amounts[0].sd < now, "{found:?}");
    assert_eq!(Robot::plain(61).watch.movements(&known, &[]), None, "nothing stands");
}

/// Four zeros off by half a degree, 15 robots each: after the three movements that an alarm asks for, 19 of 20 are named rightly.
#[test]
fn after_its_movements_an_alarm_names_the_joint() {
    let (mut alarms, mut named) = (0, 0);
    for (joint, run) in (1..=4).flat_map(|joint| (0..15).map(move |run| (joint, run))) {
        let mut robot = Robot::plain(4000 + run);
        (0..20).for_each(|_| {
            let (posture, seen) = robot.see();
            robot.hear(&posture, &seen, None);
        });
        robot.off(Block::Offset(joint), &[0.5_f64.to_radians() * if run % 2 == 0 { 1.0 } else { -1.0 }]);
        if robot.within(12).is_none() {
            continue;
        }
        alarms += 1;
        robot.postures = robot.watch.movements(&[], &world().postures).expect("a change stands").positions;
        robot.weeks = 0;
        (0..3).for_each(|_| {
            let (posture, seen) = robot.see();
            robot.hear(&posture, &seen, None);
        });
        let suspect = robot.watch.explanations().first().map(|first| first.suspect);
        named += u32::from(suspect == Some(Suspect::Zero(joint)));
    }
    assert!(alarms >= 57 && 20 * named >= 19 * alarms, "{named} of {alarms} alarms");
}

/// Nothing is measured but joints: a real Panda whose ball meets a socket once a morning. Months of that are quiet; each of its zeros that is
/// off by half a degree is found within ten mornings, and most are named.
#[test]
fn a_socket_each_morning_tells_a_zero() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let open = |file: &str| std::fs::read_to_string(folder.join(file)).map_err(|error| error.to_string());
    let text = open("panda-sockets.toml").expect("a file");
    let all = text.replace("by = \"place\"\ntrain = [\"front_center\"]", "rows = []");
    let scenario = Scenario::parse("panda-sockets.toml", &all, &open);
    let scenario = scenario.unwrap_or_else(|error| panic!("{error}"));
    let case = Case::new(&scenario).expect("measured");
    let rows: Vec<usize> = (0..case.rows.len()).collect();
    let (fit, widened) = case.standing(&rows).expect("a fit");
    let body = Body::new(&fit.belief, case.names.clone(), widened).expect("a covariance");
    let mut rng = ChaCha8Rng::seed_from_u64(1001);
    // One morning after another, with a zero that is off: the arm meets the socket all the same, its encoder says otherwise.
    let mut morning = |watch: &mut Watch, off: Option<(usize, f64)>| {
        let row = &case.rows[rng.random_range(0..rows.len())];
        let mut positions = row.positions.clone();
        if let Some((joint, by)) = off {
            positions[joint] -= by;
        }
        let sighting = Sighting {
            elapsed_years: 1.0 / 365.0,
            positions: &positions,
            observation: &row.observation,
            covariate: None,
        };
        watch.hear(&sighting).expect("heard").event
    };
    let mut quiet = Watch::new(body, plain()).expect("settings");
    for day in 1..=120 {
        assert_eq!(morning(&mut quiet, None), None, "day {day}");
    }
    let (mut found, mut named) = (0, 0);
    // The last joint turns the ball's stick, and the first all of the robot: sockets hardly tell either.
    for joint in 1..6 {
        let mut watch = quiet.clone();
        let event = (0..10).find_map(|_| morning(&mut watch, Some((joint, 0.5_f64.to_radians()))));
        let Some(event) = event else { continue };
        found += 1;
        named += usize::from(event.explanations[0].suspect == Suspect::Zero(joint));
    }
    assert!(found == 5 && named >= 3, "{found} found, {named} named");
}

#[test]
fn what_says_nothing_is_skipped_and_what_cannot_be_is_refused() {
    let mut robot = Robot::plain(71);
    let before = robot.watch.evidence();
    let (posture, seen) = robot.see();
    let mut skipped = |positions: &[f64], observation: &Observation, covariate| {
        let sighting = Sighting { elapsed_years: WEEK, positions, observation, covariate };
        robot.watch.hear(&sighting).expect_err("nothing")
    };
    assert_eq!(skipped(&posture, &Observation::missed(1), None), Skipped::Nothing);
    let nan = Observation { readings: vec![Some(vec![0.0, f64::NAN, 1.0])] };
    assert!(matches!(skipped(&posture, &nan, None), Skipped::Refused(_)));
    assert!(matches!(skipped(&posture[1..], &seen, None), Skipped::Refused(_)));
    assert!(matches!(skipped(&[f64::INFINITY; 8], &seen, None), Skipped::Refused(_)));
    assert_eq!((robot.watch.sightings(), robot.watch.evidence()), (0, before));
    let covariate = Some(Covariate { reference: None, span: 10.0 });
    let mut warm = Watch::new(world().body.clone(), Settings { covariate, ..plain() }).expect("settings");
    let sighting = Sighting { elapsed_years: WEEK, positions: &posture, observation: &seen, covariate: None };
    assert_eq!(warm.hear(&sighting), Err(Skipped::NoCovariate));
    for (rate, shares, span) in
        [(0.0, 0.0, 1.0), (f64::NAN, 0.0, 1.0), (1.0, 1.0, 1.0), (1.0, -0.1, 1.0), (1.0, 0.0, 0.0)]
    {
        let covariate = Some(Covariate { reference: None, span });
        let settings = Settings { false_alarms_per_year: rate, shares: vec![shares], covariate };
        assert!(matches!(Watch::new(world().body.clone(), settings), Err(WatchError::Setting { .. })));
    }
    // A gap of centuries, and a clock that goes back, are no alarm.
    for elapsed_years in [0.0, -3.0, f64::NAN, 700.0] {
        let sighting = Sighting { elapsed_years, positions: &posture, observation: &seen, covariate: None };
        assert_eq!(robot.watch.hear(&sighting).expect("seen").event, None);
    }
}
