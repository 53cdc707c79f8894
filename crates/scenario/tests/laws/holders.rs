//! Learners that hold the axes beside others: each is judged by what it learns itself.

use body_schema_engine::model::Block;
use body_schema_scenario::{Scenario, builtin};
use body_schema_wire::RunResult;

const HOLDER: &str =
    "[[learner]]\nname = \"nominal\"\nestimator = \"smoother\"\npolicy = \"random\"\nholds_axes = true\n\n";

/// A built-in scenario with a learner that holds its axes, before the others or after them.
fn text(name: &str, first: bool) -> String {
    let source = builtin(name).expect("built in").source.clone();
    if first {
        source.replacen("[[learner]]", &format!("{HOLDER}[[learner]]"), 1)
    } else {
        format!("{source}\n{HOLDER}")
    }
}

fn parse(text: &str) -> Result<Scenario, String> {
    Scenario::parse("holders.toml", text, &|_| Err("no data".to_owned())).map_err(|error| error.to_string())
}

/// What others learn beside it is theirs: alone or together, before or behind, every learner's figures are the same, and the bound of
/// the one that holds its axes is that of fewer parameters.
#[test]
fn who_holds_the_axes_is_judged_by_what_is_left() {
    for name in ["body-change", "arm-6dof-pose-gears", "hand-eye-6dof"] {
        let scenario = parse(&text(name, true)).expect("valid");
        let others: Vec<String> =
            scenario.learners.iter().filter(|it| it.by_default).map(|it| it.name.clone()).collect();
        let run = |scenario: &Scenario, learners: &[String]| {
            let mut experiment = scenario.experiment(1001, Some(learners)).expect("an experiment");
            (0..4).for_each(|_| _ = experiment.step().expect("a step"));
            let result = RunResult::of(&experiment);
            let metrics = experiment.latest().learners.iter().map(|learner| learner.metrics.clone());
            (metrics.collect::<Vec<_>>(), result)
        };
        let (together, result) = run(&scenario, &others);
        for (index, learner) in others.iter().enumerate() {
            let (alone, _) = run(&scenario, std::slice::from_ref(learner));
            assert_eq!(alone[0], together[index], "{name}: {learner}");
        }
        let (last, _) = run(&parse(&text(name, false)).expect("valid"), &["nominal".to_owned()]);
        assert_eq!(last[0], together[0], "{name}");
        let bound = |index: usize| together[index].bound_trace.expect("simulated, with noise");
        assert!(bound(0) < bound(1), "{name}: fewer parameters, less is open: {} {}", bound(0), bound(1));
        assert!(result.learners[0].model.joints.iter().all(|joint| !joint.learned));
        let problem = scenario.design_problem().expect("simulated");
        let axes = problem.layout.blocks().filter(|(block, _)| matches!(block, Block::Axis(_))).count();
        assert!(axes > 0 && together[0].nees_dof < together[1].nees_dof.or(Some(usize::MAX)), "{name}");
        let design = problem.best_design(5, 0.5).map(|best| body_schema_engine::design::BestDesign {
            step: 5,
            movements: 5,
            best_design_trace: best.trace,
            gap: best.gap,
            parameters: problem.layout.dimension(),
        });
        let beside = result.beside(vec![design.expect("a design")]);
        assert_eq!(beside.learners[0].efficiency, None, "{name}: there is no best design for it");
        assert!(beside.learners[1].efficiency.is_some());
    }
}

/// Where the axes are all that is learned, nobody can hold them.
#[test]
fn where_nothing_is_left_to_learn_the_file_is_refused() {
    for name in ["arm-6dof", "arm-12dof"] {
        let error = parse(&text(name, true)).expect_err("nothing is left");
        assert!(error.contains("holds_axes") && error.contains("nothing is left to learn"), "{error}");
    }
}
