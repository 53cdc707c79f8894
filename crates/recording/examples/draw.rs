use body_schema_recording::*;
use body_schema_scenario::{Scenario, builtin};
use body_schema_wire::{Description, StepReport};
fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    for arg in args {
        if arg.contains('/') {
            let text = std::fs::read_to_string(&arg).unwrap();
            let folder = std::path::Path::new(&arg).parent().unwrap().to_owned();
            let open = |file: &str| std::fs::read_to_string(folder.join(file)).map_err(|e| e.to_string());
            let scenario = Scenario::parse(&arg, &text, &open).unwrap();
            let mut appearance = Appearance::of(&scenario);
            for (name, file) in [
                ("package://panda_description/meshes/link5.stl", "meshes/link5.stl"),
                ("../meshes/link6.obj", "../meshes/link6.obj"),
            ] {
                appearance.add_mesh(name, std::fs::read(folder.join(file)).unwrap());
            }
            draw(&scenario, "shaped", 3, 1.0, appearance);
            continue;
        }
        let (name, rest) = arg.split_once(':').unwrap_or((&arg, "6"));
        let (steps, enlarge) = rest.split_once(':').unwrap_or((rest, "1"));
        let scenario = builtin(name).unwrap();
        draw(&scenario, name, steps.parse().unwrap(), enlarge.parse().unwrap(), Appearance::of(&scenario));
    }
}
fn draw(scenario: &Scenario, name: &str, steps: usize, enlarge: f64, appearance: Appearance) {
    let mut experiment = scenario.experiment(3, None).unwrap();
    let target =
        Target::file(format!("/tmp/h4p/{name}-{enlarge}.rrd")).with_appearance(appearance).with_enlarged(enlarge);
    let mut recorder = Recorder::new(&Description::of(&experiment), target).unwrap();
    recorder.log(&StepReport::of(&experiment)).unwrap();
    for _ in 0..steps {
        experiment.step().unwrap();
        recorder.log(&StepReport::of(&experiment)).unwrap();
    }
    recorder.finish().unwrap();
}
