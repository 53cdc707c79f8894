//! Fig. 3: DIRECT's partition, and its choice in the diagram of size and value.

use super::{Figure, Source};
use crate::outcome::{Outcome, Searched};
use body_schema_chart::{Axis, Chart, Colour, Layer, Marker, Panel, Style};
use body_schema_engine::{
    optimize::{Plane, Projection},
    selection::Leaf,
};
use body_schema_palette::learner_color;

const RECTANGLES: Colour = [0x88; 3];

pub fn figure(source: Source<'_>) -> Option<Figure> {
    let Outcome::Searches(searches) = source.outcome else { return None };
    let rows: Vec<Vec<Panel>> =
        searches.iter().filter_map(|search| Some(vec![slice(search)?, diagram(search)])).collect();
    let evaluations = searches.first()?.partition.leaves.len();
    let hull = Style { colour: learner_color(1), dashes: "", marker: None };
    let chart = Chart {
        title: source.title(),
        subtitle: source.provenance(),
        legend: vec![
            ("rectangles".into(), Style::points(Marker::Dot, RECTANGLES)),
            ("lower right convex hull".into(), hull),
            ("potentially optimal".into(), Style::points(Marker::Diamond, learner_color(1))),
        ],
        rows,
        notes: vec![
            format!(
                "The A-criterion C(θ) of a real selection, {evaluations} evaluations. Left: the slice of the joint box through the choice (◆);"
            ),
            "the lighter, the lower C; thick outlines: potentially optimal. Right: every rectangle of the box.".into(),
        ],
    };
    let caption = format!(
        "{}: the partition of the joint box (a slice through the choice) and every rectangle's size and value with the \
         lower right convex hull, on which the potentially optimal ones lie; DIRECT and DIRECT-l, {}",
        source.title(),
        source.provenance()
    );
    Some(Figure { id: source.experiment.id.to_owned(), caption, chart })
}

fn name(search: &Searched) -> &'static str {
    if search.variant == "direct" { "DIRECT" } else { "DIRECT-l" }
}

/// The rectangles that cut the plane of the two joints divided most, at the chosen configuration.
fn slice(search: &Searched) -> Option<Panel> {
    let leaves = &search.partition.leaves;
    let chosen = leaves.get(search.partition.chosen)?;
    let plane = Plane::most_divided(leaves.iter().map(|leaf| leaf.levels.as_slice()))?;
    let (x, y) = (plane.x, plane.y?);
    let cuts = |leaf: &&Leaf| plane.cuts(&leaf.centre, &leaf.levels, &chosen.centre);
    let mut cut: Vec<&Leaf> = leaves.iter().filter(cuts).collect();
    cut.sort_by_key(|leaf| leaf.potentially_optimal);
    let values = || cut.iter().filter_map(|leaf| leaf.value);
    let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
    let degrees = |joint: usize, place: f64| {
        let [lower, upper] = search.joints[joint].1;
        (lower + place * (upper - lower)).to_degrees()
    };
    let side = |joint: usize, centre: f64, half: f64| [centre - half, centre + half].map(|end| degrees(joint, end));
    let cell = |leaf: &&Leaf| {
        let Projection { centre, half } = plane.project(&leaf.centre, &leaf.levels);
        Layer::Cell {
            x: side(x, centre[0], half[0]),
            y: side(y, centre[1], half[1]),
            fill: grey(leaf.value.map_or(1.0, |value| if high > low { (value - low) / (high - low) } else { 0.0 })),
            outline: if leaf.potentially_optimal { 2.4 } else { 0.8 },
        }
    };
    let mut layers: Vec<Layer> = cut.iter().map(cell).collect();
    let centre = |leaf: &Leaf| [degrees(x, leaf.centre[x]), degrees(y, leaf.centre[y])];
    layers.push(Layer::Points {
        points: cut.iter().map(|leaf| centre(leaf)).collect(),
        marker: Marker::Dot,
        colour: [0x33; 3],
    });
    layers.push(Layer::Points { points: vec![centre(chosen)], marker: Marker::Diamond, colour: learner_color(1) });
    let axis = |joint: usize| {
        let label = format!("{} (deg)", search.joints[joint].0.replace('_', " "));
        Axis::linear(&label, [].into_iter()).over(degrees(joint, 0.0), degrees(joint, 1.0))
    };
    Some(Panel { title: format!("{}: partition", name(search)), x: axis(x), y: axis(y), layers })
}

/// Light for low values, which DIRECT looks for.
fn grey(value: f64) -> Colour {
    [(0xFC as f64 - value.clamp(0.0, 1.0) * 0x80 as f64) as u8; 3]
}

fn diagram(search: &Searched) -> Panel {
    let leaves = &search.partition.leaves;
    let points: Vec<[f64; 2]> =
        search.sizes.iter().zip(leaves).filter_map(|(size, leaf)| Some([*size, leaf.value?])).collect();
    let hull: Vec<[f64; 2]> = search.hull.iter().map(|point| [point.size, point.value]).collect();
    let chosen: Vec<[f64; 2]> =
        search.hull.iter().filter(|point| point.potentially_optimal).map(|point| [point.size, point.value]).collect();
    let colour = learner_color(1);
    Panel {
        title: format!("{}: size and value", name(search)),
        x: Axis::linear(
            if search.variant == "direct" { "size d: centre to corner" } else { "size d: half the longest side" },
            points.iter().map(|point| point[0]).chain([0.0]),
        ),
        y: Axis::linear("criterion C(θ)", points.iter().map(|point| point[1])),
        layers: vec![
            Layer::Points { points, marker: Marker::Dot, colour: RECTANGLES },
            Layer::Curve { points: hull, style: Style { colour, dashes: "", marker: None } },
            Layer::Points { points: chosen, marker: Marker::Diamond, colour },
        ],
    }
}
