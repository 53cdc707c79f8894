//! A robot from a measured table alone, judged on rows that are held out: five folds, or another table.
//!
//! `cargo run --release -p body-schema-discover --example measured -- TABLE [HELD_OUT]`

use body_schema_discover::{Data, Discovery, Row, answer, discover, read};

/// Folds, where no other table is held out.
const FOLDS: usize = 5;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let table = arguments.next().expect("a table");
    let load = |path: &str| {
        let text = std::fs::read_to_string(path).expect("a file");
        let table = read(&text).expect("a table");
        table.remarks.iter().for_each(|remark| println!("{remark}"));
        table.data
    };
    let data = load(&table);
    let start = std::time::Instant::now();
    let found = discover(&data).expect("a robot");
    let told = answer(&data, &found);
    println!(
        "{} rows, {:.1} s: explains {}, sure {}",
        told.rows,
        start.elapsed().as_secs_f64(),
        told.explains,
        told.sure
    );
    println!("noise {:.2} mm {:?} deg, expected error {:.2} mm", told.noise_mm, told.noise_deg, told.expected_error_mm);
    told.columns.iter().for_each(|column| println!("{}", column.message));
    told.doubts.iter().for_each(|doubt| println!("in doubt: {doubt}"));
    for other in &told.alternatives {
        println!("{:.3}: {}", other.probability, other.chain);
    }
    let mut errors = Vec::new();
    if let Some(other) = arguments.next() {
        let held_out = load(&other);
        errors = misses(&data, &found, &held_out.rows, &held_out);
    } else {
        for fold in 0..FOLDS {
            let of = |keeps: bool| -> Vec<Row> {
                let rows = data.rows.iter().enumerate().filter(|(index, _)| (index % FOLDS == fold) == keeps);
                rows.map(|(_, row)| row.clone()).collect()
            };
            let (held_out, training) = (of(true), data.with_rows(of(false)));
            let found = discover(&training).expect("a robot");
            let told = answer(&training, &found);
            let misses = misses(&data, &found, &held_out, &data);
            let mean = misses.iter().sum::<f64>() / misses.len() as f64;
            let order: Vec<&str> = told.joints.iter().map(|joint| joint.name.as_str()).collect();
            println!(
                "fold {fold}: explains {}, {:.2} mm of noise, held out {mean:.2} mm: {}",
                told.explains,
                told.noise_mm,
                order.join(" ")
            );
            errors.extend(misses);
        }
    }
    errors.sort_by(f64::total_cmp);
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    println!(
        "held out: mean {mean:.2} mm, median {:.2} mm, most {:.2} mm, {} readings",
        errors[errors.len() / 2],
        errors[errors.len() - 1],
        errors.len()
    );
}

/// Distances of predicted from measured places, mm; columns of another table are found by title.
fn misses(data: &Data, found: &Discovery, rows: &[Row], of: &Data) -> Vec<f64> {
    let column = |title: &str| of.columns.iter().position(|column| column.title == title);
    let order: Vec<Option<usize>> = data.columns.iter().map(|own| column(&own.title)).collect();
    let mut errors = Vec::new();
    for row in rows {
        let positions: Vec<f64> = order.iter().map(|of| of.map_or(0.0, |of| row.positions[of])).collect();
        for (predicted, reading) in found.fit.robot.predict(&positions).iter().zip(&row.readings) {
            errors.extend(reading.map(|reading| 1e3 * (predicted.translation.vector - reading.point().coords).norm()));
        }
    }
    errors
}
