use super::*;
use crate::scenario::{Scenario, builtin};

fn each(of: impl Fn(&str, &str, &Scenario)) {
    let only = std::env::var("PLACE").ok();
    for (name, first, places) in [
        (
            "panda-sockets",
            "front_center",
            &[
                "back_left",
                "back_right",
                "front_center",
                "front_left",
                "front_right",
                "mid-high",
                "mid_left",
                "mid_right",
            ][..],
        ),
        ("kinova-sockets", "front", &["front", "front_rotated", "left", "right-high"][..]),
    ] {
        let nominal = builtin(name).expect("built in");
        for place in places {
            if only.as_ref().is_some_and(|o| !format!("{name}:{place}").contains(o.as_str())) {
                continue;
            }
            let mut text =
                nominal.source.replacen(&format!("train = [\"{first}\"]"), &format!("train = [\"{place}\"]"), 1);
            if let Ok(criterion) = std::env::var("CRITERION") {
                text = text.replacen("criterion = \"d\"", &format!("criterion = \"{criterion}\""), 1);
            }
            let scenario = Scenario::parse("it.toml", &text, &|file| nominal.data_file(file)).expect("valid");
            of(name, place, &scenario);
        }
    }
}

#[test]
#[ignore]
fn probe_fit() {
    each(|name, place, scenario| {
        let case = Case::new(scenario).unwrap();
        let r = calibrate(&case, &Options::default(), &Silent).unwrap().report;
        let m = &r.more_rows;
        let h = r.held_out.as_ref().unwrap();
        println!(
            "{name} {place}: before {:.2} after {:.2} rms {:.2} full {:.2}; expected {:?} params {:?} model {:.3} heldout {:?} untold {:.2} span {:?}",
            h.before.mean_mm.unwrap(),
            h.after.mean_mm.unwrap(),
            h.after.rms_mm.unwrap(),
            h.full_model.mean_mm.unwrap(),
            m.expected_mm,
            m.from_parameters_mm,
            m.model_error_mm,
            m.held_out_mm,
            m.untold_mm,
            r.span_1m_sd_mm
        );
        println!("   said {}", m.said);
        println!("   verdict {:?}", r.verdict);
        for d in &r.doubts {
            println!("   doubt {d}");
        }
        for t in &r.extras {
            println!(
                "   {:?} inner {:.3?} -> {:.3?} se {:.3?} held {:.3} kept {}",
                t.extras,
                t.inner_without,
                t.inner,
                t.standard_error,
                t.held_out.as_ref().unwrap().mean_mm.unwrap(),
                t.kept
            );
        }
    });
}

#[test]
#[ignore]
fn probe_active() {
    each(|name, place, scenario| {
        let case = Case::new(scenario).unwrap();
        let splits = case.splits(None).unwrap();
        let n = 16.min(splits[0].training.len());
        let points = case.active(&splits, n, &Silent).unwrap();
        for at in [6, 8, 10, 12, 16] {
            if let Some(p) = points.get(at - 1) {
                println!(
                    "{name} {place} {:?} {at}: active {:.2} random {:.2} [{:.2} {:.2}]",
                    scenario.selection.planning.optimality,
                    p.active_mm.unwrap(),
                    p.random_median_mm.unwrap(),
                    p.random_q25_mm.unwrap(),
                    p.random_q75_mm.unwrap()
                );
            }
        }
    });
}

#[test]
#[ignore]
fn probe_off() {
    each(|name, place, scenario| println!("{name} {place}: {}", off(&Case::new(scenario).unwrap())));
}

#[test]
#[ignore]
fn probe_init() {
    for (name, urdf_file, tip) in
        [("panda-sockets", "panda.urdf", "panda_link8"), ("kinova-sockets", "gen3lite.urdf", "end_effector_link")]
    {
        let nominal = builtin(name).expect("built in");
        let table = nominal.data_file(&format!("{name}.csv")).unwrap();
        let urdf = nominal.data_file(urdf_file).unwrap();
        for d in [None, Some(0.05)] {
            let at = std::time::Instant::now();
            let begun = begin(&Sources {
                name: "it",
                urdf_file,
                urdf: &urdf,
                table_file: "t.csv",
                table: &table,
                base: None,
                tip: Some(tip),
                socket_distance_m: d,
            })
            .unwrap();
            println!("{}\n{:?}", begun.text, at.elapsed());
        }
    }
}

fn off(case: &Case<'_>) -> String {
    let splits = case.splits(None).unwrap();
    let split = &splits[0];
    let asked = case.in_sockets(&split.held_out);
    let own = case.in_sockets(&split.training);
    let nominal = case.nominal(&split.training).unwrap();
    let fit = case.fit(&case.writable(), &split.training, Some(nominal.state())).unwrap();
    let found = Figures::of(&case.residuals(&fit, &split.held_out));
    let d = case.designed(&split.training).unwrap().unwrap();
    let sd = |fit: &Fit, w: &crate::model::Workspace| {
        let j = w.jacobian(fit.state(), &fit.belief.layout);
        ((&j * fit.belief.covariance.as_ref().unwrap()).dot(&j) / w.configurations.len() as f64).sqrt() * 1e3
    };
    let mut said = format!(
        "found {:.3} mean {:.3}; plain sd asked {:.3} own {:.3}; design sd asked {:.3} own {:.3} span {:?} {:?}\n",
        found.rms_mm.unwrap(),
        found.mean_mm.unwrap(),
        sd(&fit, &asked),
        sd(&fit, &own),
        sd(&d, &asked),
        sd(&d, &own),
        case.span_sd_mm(&d),
        case.span_sd_mm(&fit)
    );
    for extras in extras::TRIED {
        let with = case.fit(&case.extended(extras, fit.state()), &split.training, Some(fit.state())).unwrap();
        let held = Figures::of(&case.residuals(&with, &split.held_out)).mean_mm.unwrap();
        let change =
            |w: &crate::model::Workspace| w.distance(&w.points(with.state()), &w.points(fit.state())).unwrap().0 * 1e3;
        let more = |w: &crate::model::Workspace| (sd(&with, w).powi(2) - sd(&fit, w).powi(2)).max(0.0).sqrt();
        said += &format!(
            "    {:4} held {:.3} change asked {:.3} own {:.3}; sd asked {:.3} own {:.3} added asked {:.3} own {:.3}\n",
            extras.iter().map(|e| &e.name()[..1]).collect::<String>(),
            held,
            change(&asked),
            change(&own),
            sd(&with, &asked),
            sd(&with, &own),
            more(&asked),
            more(&own)
        );
    }
    said
}

#[test]
#[ignore]
fn probe_choose() {
    use super::laws::{REAL, learned_at};
    let mut logs = Vec::new();
    for (name, places) in REAL {
        for place in places {
            let scenario = learned_at(name, place, "criterion = \"i\"");
            let case = Case::new(&scenario).unwrap();
            let splits = case.splits(None).unwrap();
            let (_, fits) = case.choose(&splits[0].training, &splits[0].held_out, 16, &Silent).unwrap();
            let at = |n: usize| Figures::of(&case.residuals(&fits[n - 1], &splits[0].held_out)).mean().unwrap();
            println!(
                "{name} {place}: 8 {:.2} 10 {:.2} 12 {:.2} 14 {:.2} 16 {:.2}",
                at(8),
                at(10),
                at(12),
                at(14),
                at(16)
            );
            logs.push([at(8), at(10), at(12), at(14), at(16)].map(f64::ln));
        }
        let mean = |k: usize| (logs.iter().map(|l| l[k]).sum::<f64>() / logs.len() as f64).exp();
        println!(
            "CHOICE {:?} {name} geometric means at 8 10 12 14 16: {:.3} {:.3} {:.3} {:.3} {:.3}",
            std::env::var("CHOICE"),
            mean(0),
            mean(1),
            mean(2),
            mean(3),
            mean(4)
        );
        logs.clear();
    }
}
