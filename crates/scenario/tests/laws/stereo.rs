//! Two eyes of a stereo pair: what is known of where the one is for the other tells how large the robot is.

use body_schema_engine::sensing::{InView, Occasion};
use body_schema_experiment::Gauge;
use body_schema_scenario::{Robot, Scenario, ScenarioError, WorldSpec};

/// A head of two joints with two eyes, 6 cm apart, that look at a ball on an arm of four. Nothing else measures a length.
fn stereo(baseline: &str) -> Result<Scenario, ScenarioError> {
    let joint = |name: &str, parent: &str, axis: &str, point: &str| {
        format!(
            "[[robot.joint]]\nname = \"{name}\"\n{parent}kind = \"revolute\"\naxis = {axis}\npoint_m = {point}\nlimits_deg = [-50.0, 50.0]\n"
        )
    };
    let base = "parent = \"base\"\n";
    let joints = [
        joint("pan", base, "[0.0, 0.0, 1.0]", "[0.0, 0.2, 0.25]"),
        joint("tilt", "", "[0.0, 1.0, 0.0]", "[0.02, 0.2, 0.3]"),
        joint("yaw", base, "[0.0, 0.0, 1.0]", "[0.0, 0.0, 0.0]"),
        joint("pitch", "", "[0.0, 1.0, 0.0]", "[0.0, 0.0, 0.0]"),
        joint("roll", "", "[1.0, 0.0, 0.0]", "[0.0, 0.0, 0.02]"),
        joint("elbow", "", "[0.0, 1.0, 0.0]", "[0.3, 0.0, 0.0]"),
    ]
    .concat();
    let eye = |name: &str, y: f64, more: &str| {
        format!(
            "[[camera]]\nname = \"{name}\"\nlink = \"tilt\"\nat_m = [0.08, {y}, 0.34]\nrpy_deg = [-90.0, 0.0, -90.0]\nsize_px = [640.0, \
             480.0]\nfocal_px = 350.0\nknown = {{ to_m = 0.02, to_deg = 5.0 }}\n{more}\n"
        )
    };
    let sensor = |camera: &str| {
        format!("[[sensor]]\nchannel = \"pixels\"\ncamera = \"{camera}\"\ntarget = \"ball\"\nsigma_px = 0.3\n")
    };
    let text = format!(
        "name = \"stereo\"\ntitle = \"Two eyes\"\nsteps = 30\n[robot]\n{joints}[[target]]\nname = \"ball\"\nlink = \"elbow\"\nat_m = [0.55, 0.05, 0.1]\nknown = \
         {{ to_m = 0.05 }}\n{}{}{}{}[prediction]\nof = \"ball\"\nin = \"left\"\n[view]\nvisible_pose_deg = [0.0, 10.0, 0.0, -10.0, 0.0, -20.0]\n\
         servo = [\"pan\", \"tilt\"]\n[initial_error]\ndraw = \"up_to\"\nangle_deg = 5.0\npoint_m = 0.03\n[prior]\ndirection_rad = 0.1\npoint_m \
         = 0.03\n[filter]\nmeasurement_variance_m2 = 0.09\n[selection]\nvariant = \"direct-l\"\nepsilon = 1e-4\nevaluations = 60\nunits = \"prior\"\ncriterion = \
         \"i\"\n[settled]\nexpected_prediction_m = 0.002\n[thresholds]\norientation_deg = 1.0\nlocation_m = 0.01\n[[learner]]\nname = \"global\"\nestimator = \"smoother\"\npolicy = \"active\"\n",
        eye("left", 0.23, ""),
        eye("right", 0.17, baseline),
        sensor("left"),
        sensor("right"),
    );
    Scenario::parse("stereo.toml", &text, &|_| Err("no data".to_owned()))
}

const BASELINE: &str = "stereo_with = \"left\"\nbaseline = { to_m = 0.0002, to_deg = 0.05 }";

fn valid(baseline: &str) -> Scenario {
    stereo(baseline).unwrap_or_else(|error| panic!("{error}"))
}

/// Where the whole stands nobody can tell, and of eyes whose places are guessed not how large it is.
#[test]
fn a_baseline_tells_the_size() {
    let undetermined = |baseline: &str, view: InView<'_>| {
        let scenario = valid(baseline);
        let Robot { state, layout, limits, .. } = &scenario.robot;
        Gauge::new(state, layout, &scenario.measurement_model, view, limits).undetermined()
    };
    for view in [InView::Unknown, InView::By(None)] {
        assert_eq!((undetermined("", view), undetermined(BASELINE, view)), (7, 6), "{view:?}");
    }
}

/// It is told once, before any movement, off by its σ.
#[test]
fn a_baseline_is_told_with_its_error() {
    let scenario = valid(BASELINE);
    let (measurement_model, state) = (&scenario.measurement_model, &scenario.robot.state);
    assert_eq!(measurement_model.sensors().len(), 3);
    assert_eq!(measurement_model.sensors()[2].subject().occasion, Occasion::Beforehand);
    let v: Vec<f64> = (0..10).map(|k| 0.1 * f64::from(k)).collect();
    let known = measurement_model.beforehand(state, &v).expect("known");
    let told = known.readings[2].as_ref().expect("six numbers");
    // The right eye is at x of the left one's picture.
    let exact = [0.06, 0.0, 0.0, 0.0, 0.0, 0.0];
    for (k, (told, exact)) in told.iter().zip(exact).enumerate() {
        let sigma = if k < 3 { 0.0002 } else { 0.05_f64.to_radians() };
        assert!((told - exact - sigma * v[4 + k]).abs() < 1e-12, "{k}: {told}");
    }
    assert_eq!(measurement_model.observe_in(None, state, &[0.0; 6], &v).readings[2], None, "not after a movement");
}

/// With it the ball is predicted in metres; without it to a few per cent of where it is, however often it is seen.
#[test]
fn a_baseline_is_learned_by() {
    let error = |baseline: &str, seed: u64| {
        let scenario = valid(baseline);
        let mut experiment = scenario.experiment(seed, None).expect("an experiment");
        let mut last = f64::INFINITY;
        for _ in 0..25 {
            last = experiment.step().expect("a step").learners[0].metrics.prediction_mean_m.expect("a truth");
        }
        last
    };
    let errors = |baseline: &str| {
        let mut errors: Vec<f64> = (1001..1006).map(|seed| error(baseline, seed)).collect();
        errors.sort_by(f64::total_cmp);
        errors[2]
    };
    let (without, with) = (errors(""), errors(BASELINE));
    assert!(with < 0.005 && with < 0.3 * without, "{with} {without}");
}

/// Measured rows know it as the file describes it.
#[test]
fn measured_rows_know_it_as_it_is_described() {
    let text = valid(BASELINE).source.to_string();
    let (head, _) = text.split_once("[initial_error]").expect("simulated");
    let columns = |camera: &str| format!("columns = [\"{camera}_ball_u\", \"{camera}_ball_v\"]\n");
    let head = head
        .replace("camera = \"left\"\ntarget", &format!("{}camera = \"left\"\ntarget", columns("left")))
        .replace("camera = \"right\"\ntarget", &format!("{}camera = \"right\"\ntarget", columns("right")));
    let mut head = head.split("[view]").next().unwrap_or_default().to_owned();
    for joint in ["pan", "tilt", "yaw", "pitch", "roll", "elbow"] {
        head = head.replace(&format!("name = \"{joint}\"\n"), &format!("name = \"{joint}\"\ncolumn = \"{joint}\"\n"));
    }
    let file = format!(
        "{head}[prior]\ndirection_rad = 0.1\npoint_m = 0.03\n[measurements]\nfile = \"rows.csv\"\n[held_out]\nfolds = 2\n[filter]\nmeasurement_variance_m2 = 0.09\n[selection]\nvariant = \"direct-l\"\nepsilon = 1e-4\nevaluations = 60\nunits = \"prior\"\n[settled]\nexpected_prediction_m = 0.002\n[thresholds]\norientation_deg = 1.0\nlocation_m = 0.01\n[[learner]]\nname = \"global\"\nestimator = \"smoother\"\npolicy = \"active\"\n"
    );
    let row = |k: usize| format!("0.{k},0.1,0.2,0.{k},0.1,0,300,2{k}0,280,2{k}0\n");
    let rows: String = (1..9).map(row).collect();
    let table = format!("pan,tilt,yaw,pitch,roll,elbow,left_ball_u,left_ball_v,right_ball_u,right_ball_v\n{rows}");
    let scenario =
        Scenario::parse("rows.toml", &file, &|_| Ok(table.clone())).unwrap_or_else(|error| panic!("{error}"));
    let WorldSpec::Measured { measurements, .. } = &scenario.world else { panic!("measured") };
    assert!(measurements.observations.iter().all(|observation| observation.readings.len() == 3));
    assert!(measurements.observations.iter().all(|observation| observation.readings[2].is_none()));
    let known = measurements.beforehand.as_ref().expect("known");
    let told = known.readings[2].as_ref().expect("six numbers");
    assert!((told[0] - 0.06).abs() < 1e-12 && known.readings[..2] == [None, None], "{told:?}");
}

#[test]
fn a_baseline_that_cannot_be_is_refused() {
    let known = "baseline = { to_m = 0.001, to_deg = 0.1 }";
    for (baseline, key, hint) in [
        (format!("stereo_with = \"middle\"\n{known}"), "camera[1].stereo_with", "write one of left"),
        (format!("stereo_with = \"right\"\n{known}"), "camera[1].stereo_with", "write one of left"),
        (
            "stereo_with = \"left\"\nbaseline = { to_m = 0.0, to_deg = 0.1 }".to_owned(),
            "camera[1].baseline.to_m",
            "above 0",
        ),
        ("stereo_with = \"left\"\nbaseline = { to_m = 0.001 }".to_owned(), "camera[1].baseline", "write both"),
        ("stereo_with = \"left\"".to_owned(), "camera[1].baseline", "write both"),
        (known.to_owned(), "camera[1].baseline", "write both"),
        ("stereo_with = \"left\"\nbaseline = { anywhere_m = 0.1 }".to_owned(), "camera[1].baseline", "write both"),
    ] {
        let error = stereo(&baseline).expect_err(&baseline).to_string();
        assert!(error.contains(key) && error.contains(hint), "{baseline}: {error}");
    }
    let text = valid(BASELINE).source.to_string();
    let refused = |text: &str| {
        Scenario::parse("stereo.toml", text, &|_| Err("no data".to_owned())).expect_err("refused").to_string()
    };
    let apart = refused(&text.replacen("link = \"tilt\"", "link = \"pan\"", 1));
    assert!(apart.contains("on different links"), "{apart}");
    let exactly = refused(&text.replace("known = { to_m = 0.02, to_deg = 5.0 }\n", ""));
    assert!(exactly.contains("neither of the two cameras is learned"), "{exactly}");
}
