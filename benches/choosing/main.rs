//! What choosing a posture costs beside what a user would otherwise reach for, in one run: every contestant takes its turn in
//! every round, so that whatever else the machine does meets them all. Ratios of one round are what counts.
//!
//! ```text
//! export RAYON_NUM_THREADS=1
//! cargo bench --bench choosing
//! cargo bench --features nlopt --bench choosing     # wants CMake and a C compiler
//! ```
//!
//! | contestant | what it does |
//! |---|---|
//! | choosing | [`Active`]'s choice of one posture: DIRECT-l with a budget of 600 evaluations, by NLopt's rules |
//! | criterion | 600 evaluations of the criterion alone, in one batch |
//! | DIRECT-l | the search alone, of an objective that costs next to nothing |
//! | product | P (m × m) times m × 96 for every 32 candidates: the floor of any method that multiplies by P for each |
//! | NLopt | `GN_DIRECT_L` with the same budget and the posterior's trace by the textbook's formula, with our Jacobian |
//!
//! Which of the two finds the lower value is a matter of the problem: `-- --least` compares them over 40 of each size.
//!
//! SciPy's `direct` takes its turn in a script, `benches/choosing/scipy_direct.py`; `-- --write FILE` writes it the problems, `-- --once`
//! prints what each costs us.
//!
//! P is that of the scenario's prior after ten random movements, hence dense. Below the tables stands how the cost of one evaluation
//! grows with joints and with the budget.
//!
//! The widest vector instructions that the processor has are used. What it would cost with fewer:
//! `RUSTFLAGS="--cfg disable_dispatch_avx512 --cfg disable_dispatch_avx2" cargo bench …` takes SSE alone.

use std::{hint::black_box, time::Instant};

use body_schema::{
    estimation::Belief,
    model::jacobian,
    optimize::{Direct, Settings, Variant},
    scenario::{Scenario, builtin},
    selection::{Actions, Active, Criterion, Minimiser, Past, Policy, Situation, Weights},
    sensing::MeasurementModel,
};
use nalgebra::{DMatrix, Matrix3, MatrixXx3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

mod problem;
#[cfg(feature = "nlopt")]
mod textbook;

const CASES: [&str; 3] = ["arm-6dof", "arm-12dof", "arm-20dof"];

/// Those of NLopt's `GN_DIRECT_L`, which has no ε.
const SETTINGS: Settings =
    Settings { variant: Variant::LocallyBiased, epsilon: 0.0, max_evaluations: 600, smallest_first: true };
const ROUNDS: usize = 41;
/// Of the movements before the choice.
const SEED: u64 = 3;

struct Case {
    belief: Belief,
    weights: Weights,
    actions: Actions,
    limits: Vec<(f64, f64)>,
    candidates: Vec<Vec<f64>>,
}

/// H P Hᵀ + R of the marker, and P Hᵀ.
fn innovation(belief: &Belief, covariance: &DMatrix<f64>, posture: &[f64]) -> (Matrix3<f64>, MatrixXx3<f64>) {
    let (_, h) = jacobian(&belief.state, &belief.layout, posture);
    let numerator = covariance * h.transpose();
    let s = &h * &numerator + Matrix3::identity() * belief.measurement_model.sigma().powi(2);
    (s, numerator)
}

impl Case {
    /// The covariance after ten movements, which this seed draws.
    fn new(scenario: &Scenario, seed: u64) -> Self {
        let layout = scenario.robot.layout.clone();
        let prior_sd = scenario.prior.standard_deviations(&layout);
        let weights = scenario.weights();
        let limits = scenario.robot.limits.joints().to_vec();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = || limits.iter().map(|&(lower, upper)| rng.random_range(lower..upper)).collect::<Vec<f64>>();
        let measurement_model = MeasurementModel::tracker(scenario.filter.sigma());
        let mut covariance = DMatrix::from_diagonal(&prior_sd.map(|sd| sd * sd));
        let belief = Belief::new(scenario.robot.state.clone(), layout.into(), measurement_model.into());
        for _ in 0..10 {
            let (s, numerator) = innovation(&belief, &covariance, &draw());
            covariance -= &numerator * s.try_inverse().expect("positive") * numerator.transpose();
            covariance = (&covariance + covariance.transpose()) * 0.5;
        }
        let candidates = (0..SETTINGS.max_evaluations).map(|_| draw()).collect();
        let actions = Actions::Box(scenario.robot.limits.clone());
        Self { belief: belief.with_covariance(covariance), weights, actions, limits, candidates }
    }

    fn covariance(&self) -> &DMatrix<f64> {
        self.belief.covariance.as_ref().expect("a covariance")
    }

    /// The criterion at the posture that [`Active`] chooses by so many evaluations.
    fn choose(&self, max_evaluations: usize) -> f64 {
        self.choose_by(Settings { max_evaluations, ..SETTINGS }).0
    }

    /// The least value, and by how many evaluations it was found: DIRECT leaves a rectangle that it cannot divide along all its
    /// longest sides.
    fn choose_by(&self, settings: Settings) -> (f64, usize) {
        let active = Active::new(self.weights.clone(), Minimiser::Direct(settings));
        let history = Past::default();
        let situation =
            Situation { belief: &self.belief, actions: &self.actions, history: &history, constraints: None };
        let selection = active.select(&situation, &mut ChaCha8Rng::seed_from_u64(1)).expect("a selection");
        (selection.criterion.expect("a criterion"), selection.evaluations)
    }

    fn evaluate(&self) -> f64 {
        let criterion = Criterion::new(&self.belief, &self.weights).expect("a covariance");
        criterion.evaluate(&self.candidates)[0]
    }

    fn search(&self) -> f64 {
        let mut direct = Direct::new(self.limits.len(), SETTINGS).expect("valid settings");
        let mut values = Vec::new();
        while let Some(batch) = direct.ask() {
            values.clear();
            values.extend(batch.iter().map(|x| x.iter().map(|x| (x - 0.3).powi(2)).sum::<f64>()));
            direct.tell(&values).expect("as many values as points");
        }
        direct.best().expect("a value").1
    }

    fn multiply(&self, rows: &DMatrix<f64>, product: &mut DMatrix<f64>) -> f64 {
        for _ in 0..SETTINGS.max_evaluations.div_ceil(32) {
            product.gemm(1.0, self.covariance(), black_box(rows), 0.0);
        }
        product[(0, 0)]
    }
}

/// Who takes a turn in every round, and what it does.
type Contestant<'a> = (&'a str, Box<dyn FnMut() -> f64 + 'a>);

/// Microseconds that each contestant took in each round.
fn race(contestants: &mut [Contestant<'_>]) -> Vec<Vec<f64>> {
    let mut times = vec![Vec::with_capacity(ROUNDS); contestants.len()];
    for round in 0..=ROUNDS {
        for ((_, run), times) in contestants.iter_mut().zip(&mut times) {
            let start = Instant::now();
            black_box(run());
            // The first round warms caches.
            if round > 0 {
                times.push(start.elapsed().as_secs_f64() * 1e6);
            }
        }
    }
    times
}

/// Median and quartiles.
fn spread(values: impl Iterator<Item = f64>) -> [f64; 3] {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    [2, 1, 3].map(|quarter| sorted[(sorted.len() - 1) * quarter / 4])
}

/// A chain of revolute joints 0.1 m apart, whose axes turn.
fn chain(joints: usize) -> Scenario {
    let axes = ["[0.0, 0.0, 1.0]", "[0.0, 1.0, 0.0]", "[1.0, 0.0, 0.0]"];
    let joint = |index: usize| {
        let (axis, x) = (axes[index % 3], 0.1 * index as f64);
        format!(
            "[[robot.joint]]\nname = \"joint_{index}\"\nkind = \"revolute\"\naxis = {axis}\npoint_m = [{x:?}, 0.02, 0.0]\n\
             limits_deg = [-90.0, 90.0]\n"
        )
    };
    let text = format!(
        "name = \"chain\"\ntitle = \"A chain\"\nsteps = 10\n[robot]\nmarker_m = [{:?}, 0.05, 0.05]\nlearn_marker = false\n{}\
         [sensor]\nsigma_m = 0.01\n[initial_error]\ndraw = \"up_to\"\nangle_deg = 45.0\npoint_m = 0.4\n\
         [prior]\ndirection_rad = 0.6\npoint_m = 0.4\n\
         [filter]\nmeasurement_variance_m2 = 0.005\nstabilising_noise = {{ variance = 0.01, first_step = 1, every = 1 }}\n\
         [selection]\nvariant = \"direct-l\"\nepsilon = 1e-4\nevaluations = 300\n\
         units = \"characteristic_length\"\ncharacteristic_length_m = 1.0\n\
         [thresholds]\norientation_deg = 5.0\nlocation_m = 0.02\n[settled]\nexpected_prediction_m = 0.025\n\
         [[learner]]\nname = \"active\"\nestimator = \"rls\"\npolicy = \"active\"\n",
        0.1 * joints as f64,
        (0..joints).map(joint).collect::<String>(),
    );
    Scenario::parse("chain.toml", &text, &|_| Err("no other file".into())).expect("a scenario")
}

/// What grows, and what one evaluation costs of it beside the first of its kind.
fn growth(title: &str, mut contestants: Vec<Contestant<'_>>, evaluations: impl Fn(usize) -> usize) {
    println!("\n{title}: microseconds for one evaluation, and as a multiple of the first");
    let mut times = race(&mut contestants);
    for (index, times) in times.iter_mut().enumerate() {
        times.iter_mut().for_each(|time| *time /= evaluations(index) as f64);
    }
    for ((name, _), times_of) in contestants.iter().zip(&times) {
        let [median, low, high] = spread(times_of.iter().copied());
        let [ratio, least, most] = spread(times_of.iter().zip(&times[0]).map(|(time, first)| time / first));
        println!("  {name:10} {median:8.4} ({low:.4} to {high:.4})   {ratio:6.3} ({least:.3} to {most:.3})");
    }
}

/// What one choice of each case takes, µs, and the least value it finds: medians, without a table.
fn once() {
    for name in CASES {
        let case = Case::new(&builtin(name).expect("built in"), SEED);
        let times = race(&mut [("choosing", Box::new(|| case.choose(SETTINGS.max_evaluations)))]);
        println!("{name} {:.2} {:e}", spread(times[0].iter().copied())[0], case.choose(SETTINGS.max_evaluations));
    }
}

/// How the least values compare with NLopt's, by as many evaluations, over many problems. NLopt has no ε.
#[cfg(feature = "nlopt")]
fn least() {
    println!(
        "our least value beside NLopt's over 40 problems: median of the relative difference (quartiles), lower, equal, higher"
    );
    for name in CASES {
        let scenario = builtin(name).expect("built in");
        let cases: Vec<Case> = (1001..=1040).map(|seed| Case::new(&scenario, seed)).collect();
        for (epsilon, smallest_first) in [(1e-4, false), (0.0, false), (0.0, true)] {
            let difference = |case: &Case| {
                let (ours, evaluations) = case.choose_by(Settings { epsilon, smallest_first, ..SETTINGS });
                ours / textbook::minimise(case, evaluations) - 1.0
            };
            let differences: Vec<f64> = cases.iter().map(difference).collect();
            let [median, low, high] = spread(differences.iter().copied());
            let count = |is: fn(f64) -> bool| differences.iter().filter(|difference| is(**difference)).count();
            let counts = [count(|d| d < -1e-9), count(|d| d.abs() <= 1e-9), count(|d| d > 1e-9)];
            let first = if smallest_first { "smallest" } else { "largest" };
            println!(
                "  {name:10} epsilon {epsilon:5.0e}, {first:8} first {median:9.1e} ({low:.1e} to {high:.1e})   {counts:?}"
            );
        }
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if let Some(option) = arguments.iter().position(|argument| argument == "--write") {
        let file = arguments.get(option + 1).expect("--write FILE");
        return problem::write(file);
    }
    if arguments.iter().any(|argument| argument == "--once") {
        return once();
    }
    #[cfg(feature = "nlopt")]
    if arguments.iter().any(|argument| argument == "--least") {
        return least();
    }
    println!("microseconds for 600 evaluations, and as a multiple of choosing: median (quartiles) of {ROUNDS} rounds");
    for name in CASES {
        let case = Case::new(&builtin(name).expect("built in"), SEED);
        let m = case.covariance().nrows();
        println!("\n{name}, m = {m}");
        let rows = DMatrix::from_fn(m, 96, |i, j| ((7 * i + 3 * j) % 11) as f64 - 5.0);
        let mut product = DMatrix::zeros(m, 96);
        #[cfg(feature = "nlopt")]
        let (ours, evaluations) = case.choose_by(SETTINGS);
        let mut contestants: Vec<Contestant<'_>> = vec![
            ("choosing", Box::new(|| case.choose(SETTINGS.max_evaluations))),
            ("criterion", Box::new(|| case.evaluate())),
            ("DIRECT-l", Box::new(|| case.search())),
            ("product", Box::new(|| case.multiply(&rows, &mut product))),
        ];
        #[cfg(feature = "nlopt")]
        contestants.push(("NLopt", Box::new(|| textbook::minimise(&case, evaluations))));
        let times = race(&mut contestants);
        for ((name, _), times_of) in contestants.iter().zip(&times) {
            let [median, low, high] = spread(times_of.iter().copied());
            let [ratio, least, most] = spread(times_of.iter().zip(&times[0]).map(|(time, choosing)| time / choosing));
            println!("  {name:10} {median:8.1} ({low:.1} to {high:.1})   {ratio:6.3} ({least:.3} to {most:.3})");
        }
        #[cfg(feature = "nlopt")]
        println!("  least value found: ours {ours:.6e}, NLopt's {:.6e}", textbook::minimise(&case, evaluations));
    }

    let joints = [12, 3, 6, 20, 30, 40];
    let names = joints.map(|joints| format!("{joints} joints"));
    let cases = joints.map(|joints| Case::new(&chain(joints), SEED));
    let choosing = cases.iter().zip(&names);
    let choosing =
        choosing.map(|(case, name)| (name.as_str(), Box::new(|| case.choose(600)) as Box<dyn FnMut() -> f64>));
    growth("joints", choosing.collect(), |_| 600);

    let budgets = [600, 150, 300, 1_200, 2_400];
    let names = budgets.map(|budget| budget.to_string());
    let case = &cases[0];
    let choosing = budgets.iter().zip(&names);
    let choosing =
        choosing.map(|(budget, name)| (name.as_str(), Box::new(|| case.choose(*budget)) as Box<dyn FnMut() -> f64>));
    growth("evaluations, 12 joints", choosing.collect(), |index| budgets[index]);
}
