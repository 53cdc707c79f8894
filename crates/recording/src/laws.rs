//! What is in a scene, read back from recordings.

use std::{collections::BTreeMap, io::Cursor};

use nalgebra::Vector3;

use ::rerun::components::{LineStrip2D, LineStrip3D};

use super::{
    Appearance, LiveLog, Recorder, Target, decoded,
    rerun::{Chunk, LogMsg},
};
use body_schema_scenario::{Scenario, builtin};
use body_schema_wire::{Description, StepReport};

/// The rows of a recording by entity, the names of its views, the reports that it is of, and its bytes as a file.
pub(super) struct Recorded {
    chunks: BTreeMap<String, Vec<Chunk>>,
    pub(super) views: Vec<String>,
    pub(super) reports: Vec<StepReport>,
    bytes: usize,
}

impl Recorded {
    pub(super) fn of(
        scenario: &Scenario,
        steps: usize,
        learners: Option<&[String]>,
        target: impl Fn(Target) -> Target,
    ) -> Self {
        let mut experiment = scenario.experiment(3, learners).expect("an experiment");
        let description = Description::of(&experiment);
        let mut reports = vec![StepReport::of(&experiment)];
        for _ in 0..steps {
            experiment.step().expect("a step");
            reports.push(StepReport::of(&experiment));
        }
        Self::of_reports(&description, reports, target)
    }

    pub(super) fn of_reports(
        description: &Description,
        reports: Vec<StepReport>,
        target: impl Fn(Target) -> Target,
    ) -> Self {
        let live = LiveLog::new();
        let mut recorder = Recorder::new(description, target(Target::live(live.clone()))).expect("begun");
        reports.iter().for_each(|report| recorder.log_moving(report, 2).expect("recorded"));
        recorder.seal().expect("sealed");
        let bytes = live.complete().expect("put together");
        let mut chunks: BTreeMap<String, Vec<Chunk>> = BTreeMap::new();
        let mut views = Vec::new();
        for message in decoded::messages(Cursor::new(&bytes)) {
            if let LogMsg::ArrowMsg(store, message) = message.expect("a message") {
                let chunk = Chunk::from_arrow_msg(&message).expect("a chunk");
                if store.is_recording() {
                    chunks.entry(chunk.entity_path().to_string()).or_default().push(chunk);
                } else {
                    let names = chunk.iter_slices::<String>("ViewBlueprint:display_name".into());
                    views.extend(
                        names.flat_map(|row| row.iter().map(|name| name.as_str().to_owned()).collect::<Vec<_>>()),
                    );
                }
            }
        }
        Self { chunks, views, reports, bytes: bytes.len() }
    }

    fn rows<'a, T>(
        &'a self,
        entity: &str,
        component: &'static str,
        read: impl Fn(&'a Chunk) -> Vec<T>,
    ) -> Vec<(i64, T)> {
        let chunks = self.chunks.get(entity).into_iter().flatten();
        let rows = chunks.flat_map(|chunk| {
            let times = chunk.iter_component_indices("step".into(), component.into());
            times.map(|(time, _)| time.as_i64()).zip(read(chunk)).collect::<Vec<_>>()
        });
        rows.collect()
    }

    /// The numbers of a component, row by row with the step (`i64::MIN` for what holds always).
    pub(super) fn singles(&self, entity: &str, component: &'static str) -> Vec<(i64, Vec<f32>)> {
        self.rows(entity, component, |chunk| chunk.iter_slices::<f32>(component.into()).map(<[_]>::to_vec).collect())
    }

    /// The pairs of a component likewise.
    pub(super) fn pairs(&self, entity: &str, component: &'static str) -> Vec<(i64, Vec<[f32; 2]>)> {
        self.rows(entity, component, |chunk| {
            chunk.iter_slices::<[f32; 2]>(component.into()).map(<[_]>::to_vec).collect()
        })
    }

    /// The quadruples of a component likewise.
    pub(super) fn quads(&self, entity: &str, component: &'static str) -> Vec<(i64, Vec<[f32; 4]>)> {
        self.rows(entity, component, |chunk| {
            chunk.iter_slices::<[f32; 4]>(component.into()).map(<[_]>::to_vec).collect()
        })
    }

    /// The lists of pairs of a component, row by row.
    pub(super) fn pairs_of_lists(&self, entity: &str, component: &'static str) -> Vec<Vec<Vec<[f32; 2]>>> {
        let rows = self.rows(entity, component, |chunk| {
            let rows = chunk.iter_component::<LineStrip2D>(component.into());
            rows.map(|row| row.as_slice().iter().map(|line| line.0.iter().map(|at| at.0).collect()).collect()).collect()
        });
        rows.into_iter().map(|(_, row)| row).collect()
    }

    /// The lists of triples of a component, row by row.
    pub(super) fn triples_of_lists(&self, entity: &str, component: &'static str) -> Vec<Vec<Vec<[f32; 3]>>> {
        let rows = self.rows(entity, component, |chunk| {
            let rows = chunk.iter_component::<LineStrip3D>(component.into());
            rows.map(|row| row.as_slice().iter().map(|line| line.0.iter().map(|at| at.0).collect()).collect()).collect()
        });
        rows.into_iter().map(|(_, row)| row).collect()
    }

    /// The triples of a component, row by row with the step (`i64::MIN` for what holds always).
    pub(super) fn triples(&self, entity: &str, component: &'static str) -> Vec<(i64, Vec<[f32; 3]>)> {
        self.rows(entity, component, |chunk| {
            chunk.iter_slices::<[f32; 3]>(component.into()).map(<[_]>::to_vec).collect()
        })
    }

    fn labels(&self, entity: &str, component: &'static str) -> Vec<String> {
        let rows = self.rows(entity, component, |chunk| {
            let texts = chunk.iter_slices::<String>(component.into());
            texts.map(|row| row.iter().map(|text| text.as_str().to_owned()).collect::<Vec<_>>()).collect()
        });
        rows.into_iter().flat_map(|(_, labels)| labels).collect()
    }

    pub(super) fn has(&self, entity: &str) -> bool {
        self.chunks.contains_key(entity)
    }
}

/// Whether two points are one, but for what single precision does to them.
pub(super) fn is_near(found: [f32; 3], expected: Vector3<f64>) -> bool {
    (Vector3::from(found.map(f64::from)) - expected).norm() < 1e-5
}

#[test]
fn obstacles_stand_around_every_robot_and_in_none_of_its_neighbours() {
    let scenario = builtin("arm-6dof-table").expect("a scenario");
    let recorded = Recorded::of(&scenario, 1, None, |target| target.with_appearance(Appearance::of(&scenario)));
    let constraints = scenario.constraints.as_ref().expect("constraints");
    let centres =
        |learner: &str| recorded.triples(&format!("/{learner}/body/obstacles"), "Boxes3D:centers")[0].1.clone();
    for learner in ["active", "random"] {
        for (centre, obstacle) in centres(learner).into_iter().zip(&constraints.obstacles) {
            assert!(is_near(centre, nalgebra::center(&obstacle.lower, &obstacle.upper).coords), "{centre:?}");
        }
    }
    let [.., least] = centres("active")[..] else { panic!("boxes") };
    assert!((least[2] + 0.45).abs() < 1e-6, "{least:?}");
    let names = recorded.labels("/active/body/obstacles/names", "Points3D:labels");
    assert_eq!(names, ["table", "pillar", "no lower than -0.45 m"]);
    assert!(!recorded.has("/random/body/obstacles/names"), "names are said once");
    let place = |learner: &str| {
        let [x, y, z] = recorded.triples(&format!("/{learner}"), "Transform3D:translation")[0].1[0];
        Vector3::new(f64::from(x), f64::from(y), f64::from(z))
    };
    let apart = place("random") - place("active");
    for obstacle in &constraints.obstacles {
        let sides = obstacle.upper - obstacle.lower;
        assert!((0..3).any(|k| apart[k].abs() > sides[k]), "{}: {apart}", obstacle.name);
    }
    let without = builtin("arm-6dof").expect("a scenario");
    let without = Recorded::of(&without, 0, None, |target| target.with_appearance(Appearance::of(&without)));
    assert!(!without.has("/active/body/obstacles"));
}

/// The Panda of `panda-calibration`, some of whose links have shapes.
fn shaped() -> Scenario {
    let scenario = builtin("panda-calibration").expect("a scenario");
    let open = |file: &str| {
        let mut text = scenario.data_file(file)?;
        for (mesh, shape) in [
            ("link2.dae", r#"<cylinder radius="0.06" length="0.2"/>"#),
            ("link3.dae", r#"<box size="0.1 0.2 0.3"/>"#),
            ("link4.dae", r#"<sphere radius="0.07"/>"#),
            ("link5.dae", r#"<mesh filename="link5.stl" scale="0.001 0.001 0.001"/>"#),
        ] {
            let mesh = format!("<mesh filename=\"../meshes/panda/{mesh}\"/>");
            assert!(text.contains(&mesh), "{mesh}");
            text = text.replace(&mesh, shape);
        }
        Ok(text)
    };
    Scenario::parse("shaped", &scenario.source, &open).expect("a scenario")
}

const STL: &[u8] = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n";

#[test]
fn shapes_are_said_once_and_moved_with_their_links() {
    let scenario = shaped();
    let mut appearance = Appearance::of(&scenario);
    assert!(appearance.undrawn_meshes().contains("link5.stl"));
    assert!(appearance.add_mesh("link5.stl", STL.to_vec()) && !appearance.add_mesh("../link1.dae", Vec::new()));
    assert!(!appearance.undrawn_meshes().contains("link5.stl"));
    let steps = 6;
    let recorded = Recorded::of(&scenario, steps, None, |target| target.with_appearance(appearance.clone()));
    let learner = &recorded.reports[0].learners[0].name;
    let described = scenario.robot.described.as_ref().expect("a URDF");
    let truth = format!("/{learner}/arm/truth");
    let link = |name: &str| 1 + described.chain.segments.iter().position(|it| it.link == name).expect("a link");
    let boxes = recorded.triples(&truth, "Boxes3D:centers");
    assert_eq!(boxes.len(), steps + 1);
    let meshes = recorded.triples(&format!("{truth}/mesh-1"), "Transform3D:translation");
    for (report, ((step, boxes), (_, mesh))) in recorded.reports.iter().zip(boxes.iter().zip(&meshes)).skip(1) {
        assert_eq!(*step, report.step as i64);
        let movement = report.learners[0].movement.as_ref().expect("a movement");
        let links = described.chain.links(&movement.configuration);
        assert!(is_near(boxes[0], links[link("panda_link3")].translation.vector), "step {step}: {boxes:?}");
        assert!(is_near(mesh[0], links[link("panda_link5")].translation.vector), "step {step}: {mesh:?}");
    }
    assert_eq!(recorded.triples(&truth, "Boxes3D:half_sizes"), [(0, vec![[0.05, 0.1, 0.15]])]);
    assert_eq!(recorded.triples(&truth, "Ellipsoids3D:half_sizes"), [(0, vec![[0.07; 3]])]);
    let scale = recorded.triples(&format!("{truth}/mesh-1"), "InstancePoses3D:scales");
    assert_eq!(scale, [(i64::MIN, vec![[0.001; 3]])]);
    // Four links of the seven that move have a shape; every joint keeps its pin.
    for (step, capsules) in recorded.triples(&truth, "Capsules3D:translations") {
        assert_eq!(capsules.len(), 3 + 7, "step {step}");
    }
    // A learner's axes are wrong at first, and its shapes with them.
    let estimate = recorded.triples(&format!("/{learner}/arm/estimate"), "Boxes3D:centers");
    assert!((Vector3::from(estimate[0].1[0]) - Vector3::from(boxes[0].1[0])).norm() > 1e-4);
    // Each step adds the poses of the shapes and no more: 3 shapes and a mesh of 4 arms, 28 bytes a pose, and what a row costs.
    let grows = |target: &dyn Fn(Target) -> Target| {
        let bytes = |steps| Recorded::of(&scenario, steps, None, target).bytes as i64;
        bytes(steps) - bytes(2)
    };
    let more = grows(&|target| target.with_appearance(appearance.clone())) - grows(&|target| target);
    assert!(more < 4 * 4 * (4 * 28 + 200), "{more} bytes more in 4 steps");
}

#[test]
fn differences_of_real_robots_are_enlarged() {
    let reach_of = |times: Option<f64>| {
        let scenario = builtin("tiago-mocap-3").expect("a scenario");
        let recorded = Recorded::of(&scenario, 3, None, |target| match times {
            Some(times) => target.with_enlarged(times).with_appearance(Appearance::of(&scenario)),
            None => target.with_appearance(Appearance::of(&scenario)),
        });
        let learner = recorded.reports[0].learners[0].name.clone();
        let ends = |path: &str| {
            let rows = recorded.triples(&format!("/{learner}/arm/{path}"), "Capsules3D:translations");
            rows.last().map(|(_, points)| points.clone())
        };
        (ends("estimate").expect("an arm"), ends("described"), recorded.labels("/key", "Points3D:labels").concat())
    };
    let (plain, described, key) = reach_of(None);
    assert!(described.is_none() && !key.contains('×'), "{key}");
    let (enlarged, described, key) = reach_of(Some(5.0));
    assert!(key.contains("× 5"), "{key}");
    let described = described.expect("the description beside it");
    // At joints whose frame moves little, five times as far from where they are described.
    let apart = |from: &[[f32; 3]]| -> f32 {
        let joints = from.iter().zip(&described).take(3);
        joints.map(|(a, b)| (Vector3::from(*a) - Vector3::from(*b)).norm()).sum()
    };
    let ratio = apart(&enlarged) / apart(&plain);
    assert!((4.0..6.0).contains(&ratio), "{ratio}: {} and {}", apart(&enlarged), apart(&plain));
}
