//! The convex hulls of links: what a robot is made of, as far as it may hit itself.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Point3;

use body_schema_engine::elementary::{cos, sin};

use super::{
    Shape, Solid, Urdf,
    mesh::{self, Triangle},
};

/// The corners of a polygon that stands for a circle.
const ROUND: usize = 12;
/// Directions in which a mesh's furthest corners are kept. What lies between two of them is less than 1 % of the mesh's size off.
const DIRECTIONS: usize = 200;
/// Into how many slices a mesh is cut.
const SLICES: usize = 3;

/// Convex hulls by the link that they are on, each as its corners in the link's frame, metres.
///
/// As text it is JSON: `{"forearm": [[[x, y, z], …], …], …}`, a list of hulls for each link.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hulls(pub BTreeMap<String, Vec<Vec<[f64; 3]>>>);

impl Hulls {
    /// Of the `<collision>`s of every link; of a link without one of its `<visual>`s, if a mesh is among them, as others may be marks. `content` is the content of a mesh's file by its
    /// name in the description. Tells the meshes that are not there or of no known kind, too: a link with one of them has no hulls.
    pub fn of(urdf: &Urdf, content: &mut dyn FnMut(&str) -> Option<Vec<u8>>) -> (Self, BTreeSet<String>) {
        let (mut hulls, mut unread) = (BTreeMap::new(), BTreeSet::new());
        for (link, shapes) in urdf.links().iter().zip(&urdf.shapes) {
            let is_mesh = |shape: &Shape| matches!(shape.solid, Solid::Mesh { .. });
            let shapes = match &shapes.collision[..] {
                [] if shapes.visual.iter().any(is_mesh) => &shapes.visual[..],
                collision => collision,
            };
            let of_link: Option<Vec<_>> = shapes
                .iter()
                .map(|shape| {
                    let of_shape = of_shape(shape, content);
                    if let (Solid::Mesh { file, .. }, None) = (&shape.solid, &of_shape) {
                        unread.insert(file.clone());
                    }
                    of_shape
                })
                .collect();
            if let Some(of_link) = of_link.filter(|of_link| !of_link.is_empty()) {
                hulls.insert(link.clone(), of_link.concat());
            }
        }
        (Self(hulls), unread)
    }

    /// The same with the meshes that are beside a description; `None` if none is.
    pub fn of_meshes(urdf: &Urdf, content: impl Fn(&str) -> Option<Vec<u8>>) -> (Option<Self>, BTreeSet<String>) {
        let mut is_any = false;
        let (hulls, unread) = Self::of(urdf, &mut |file| {
            let content = content(file);
            is_any |= content.is_some();
            content
        });
        (is_any.then_some(hulls), unread)
    }

    /// As it is written by [`Display`](std::fmt::Display).
    ///
    /// # Errors
    ///
    /// A clause that says what is wrong, and where.
    pub fn parse(text: &str) -> Result<Self, String> {
        let hulls: BTreeMap<String, Vec<Vec<[f64; 3]>>> =
            serde_json::from_str(text).map_err(|error| error.to_string())?;
        match hulls.iter().find(|(_, hulls)| hulls.iter().any(Vec::is_empty)) {
            Some((link, _)) => Err(format!("a hull of link `{link}` has no corner")),
            None => Ok(Self(hulls)),
        }
    }
}

impl std::fmt::Display for Hulls {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let links: Vec<String> = self
            .0
            .iter()
            .map(|(link, hulls)| {
                let number = |number: &f64| ((number * 1e5).round() / 1e5 + 0.0).to_string();
                let corner = |corner: &[f64; 3]| format!("[{}]", corner.each_ref().map(number).join(","));
                let hull =
                    |hull: &Vec<[f64; 3]>| format!("[{}]", hull.iter().map(corner).collect::<Vec<_>>().join(","));
                let hulls = hulls.iter().map(hull).collect::<Vec<_>>().join(",\n ");
                format!("{}: [{hulls}]", serde_json::Value::from(link.as_str()))
            })
            .collect();
        writeln!(f, "{{\n{}\n}}", links.join(",\n"))
    }
}

/// The hulls of one shape, in the link's frame.
fn of_shape(shape: &Shape, content: &mut dyn FnMut(&str) -> Option<Vec<u8>>) -> Option<Vec<Vec<[f64; 3]>>> {
    let hulls = match &shape.solid {
        Solid::Mesh { file, scale: [x, y, z] } => slices(
            &mesh::triangles(&content(file)?)?
                .iter()
                .map(|triangle| triangle.map(|[a, b, c]| [a * x, b * y, c * z]))
                .collect::<Vec<_>>(),
        ),
        solid => vec![solid.corners()],
    };
    let placed = |corner: [f64; 3]| (shape.origin * Point3::from(corner)).into();
    Some(hulls.into_iter().map(|hull| furthest(hull).into_iter().map(placed).collect()).collect())
}

/// The corners of a mesh in slices across its longest side, those among them in which its triangles are cut: a link that is bent has hulls
/// that are nearer to it than one is.
fn slices(triangles: &[Triangle]) -> Vec<Vec<[f64; 3]>> {
    let range = |side: usize| {
        let along = triangles.iter().flatten().map(|corner| corner[side]);
        along.fold((f64::INFINITY, f64::NEG_INFINITY), |(lower, upper), at| (lower.min(at), upper.max(at)))
    };
    let lengths = [0, 1, 2].map(|side| (side, range(side)));
    let longest = lengths.into_iter().max_by(|(_, (a, b)), (_, (c, d))| (b - a).total_cmp(&(d - c)));
    let Some((side, (lower, upper))) = longest else { return Vec::new() };
    let cut = |slice: usize| lower + (upper - lower) * slice as f64 / SLICES as f64;
    let within = |slice: usize| {
        let (from, to) = (cut(slice), cut(slice + 1));
        let corners = triangles.iter().flat_map(move |triangle| {
            let inside = triangle.iter().filter(move |corner| (from..=to).contains(&corner[side])).copied();
            let edges = [[0, 1], [1, 2], [2, 0]].map(|ends| ends.map(|end| triangle[end]));
            let crossed = edges.into_iter().flat_map(move |[a, b]| {
                [from, to].into_iter().filter_map(move |plane| {
                    let share = (plane - a[side]) / (b[side] - a[side]);
                    (share > 0.0 && share < 1.0).then(|| [0, 1, 2].map(|k| a[k] + share * (b[k] - a[k])))
                })
            });
            inside.chain(crossed)
        });
        // A corner is that of several triangles.
        let bits = |corner: &[f64; 3]| corner.map(f64::to_bits);
        let mut known = BTreeSet::new();
        corners.filter(|corner| known.insert(bits(corner))).collect::<Vec<_>>()
    };
    (0..SLICES).map(within).filter(|corners| !corners.is_empty()).collect()
}

impl Solid {
    /// Corners of a hull that holds the shape; none of a mesh.
    pub(super) fn corners(&self) -> Vec<[f64; 3]> {
        // A polygon around a circle.
        let around = 1.0 / cos(std::f64::consts::PI / ROUND as f64);
        let ring = |radius: f64, z: f64| {
            (0..ROUND).map(move |k| {
                let angle = std::f64::consts::TAU * k as f64 / ROUND as f64;
                [radius * around * cos(angle), radius * around * sin(angle), z]
            })
        };
        match self {
            Self::Box(sides) => {
                let at = |corner: usize, side: usize| if corner >> side & 1 == 1 { 0.5 } else { -0.5 } * sides[side];
                (0..8).map(|corner| [0, 1, 2].map(|side| at(corner, side))).collect()
            }
            Self::Cylinder { radius_m, length_m } => {
                [-0.5, 0.5].iter().flat_map(|end| ring(*radius_m, end * length_m)).collect()
            }
            Self::Ball(radius) => {
                // Circles of latitude, the poles among them, as far apart as the corners of each.
                let (radius, poles) = (radius * around, ROUND / 2);
                let rings = (0..=poles).map(|k| std::f64::consts::PI * k as f64 / poles as f64);
                rings.flat_map(|angle| ring(radius * sin(angle), -radius * around * cos(angle))).collect()
            }
            Self::Mesh { .. } => Vec::new(),
        }
    }
}

/// Those corners that are furthest in some of many directions, all of a few.
fn furthest(corners: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
    if corners.len() <= 2 * ROUND {
        return corners;
    }
    /// The angle between one direction and the next around z, which leaves no gaps (that of a sunflower's seeds).
    const GOLDEN: f64 = 2.399_963_229_728_653;
    let spread = (0..DIRECTIONS).map(|k| {
        let z = 1.0 - (2.0 * k as f64 + 1.0) / DIRECTIONS as f64;
        let (around, out) = (GOLDEN * k as f64, (1.0 - z * z).sqrt());
        [out * cos(around), out * sin(around), z]
    });
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let kept: BTreeSet<usize> = spread
        .chain(axes)
        .chain(axes.map(|axis| axis.map(|x: f64| -x)))
        .filter_map(|[x, y, z]| {
            let along = |[a, b, c]: &[f64; 3]| a * x + b * y + c * z;
            let furthest = corners.iter().enumerate().max_by(|(_, a), (_, b)| along(a).total_cmp(&along(b)));
            furthest.map(|(index, _)| index)
        })
        .collect();
    kept.into_iter().map(|index| corners[index]).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    const ROBOT: &str = r#"<robot name="r">
      <link name="base"><collision><geometry><box size="2 4 6"/></geometry></collision></link>
      <link name="rod">
        <visual><geometry><mesh filename="package://r/none.dae"/></geometry></visual>
        <collision><origin xyz="0 0 0.5"/><geometry><cylinder radius="0.02" length="1"/></geometry></collision>
        <collision><origin xyz="0 0 1"/><geometry><sphere radius="0.1"/></geometry></collision>
      </link>
      <link name="hand"><visual><geometry><mesh filename="hand.obj" scale="0.001 0.001 0.001"/></geometry></visual></link>
      <link name="tool"><collision><geometry><mesh filename="none.stl"/></geometry></collision></link>
      <link name="frame"><visual><geometry><sphere radius="0.01"/></geometry></visual></link>
    </robot>"#;

    /// The greatest coordinates of a hull.
    fn upper(hull: &[[f64; 3]]) -> [f64; 3] {
        [0, 1, 2].map(|side| hull.iter().map(|corner| corner[side]).fold(f64::MIN, f64::max))
    }

    #[test]
    fn every_shape_has_a_hull_that_holds_it() {
        let urdf = Urdf::parse(ROBOT).unwrap();
        // A ball of many corners, inside and outside.
        let ball = Solid::Ball(50.0).corners();
        let corners: Vec<[f64; 3]> = (1..=40)
            .flat_map(|shell| ball.iter().map(move |corner| corner.map(|x| x * f64::from(shell) / 40.0)))
            .collect();
        let mut obj: String = corners.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
        (1..corners.len() - 1).for_each(|k| obj += &format!("f {k} {} {}\n", k + 1, k + 2));
        let mut content = |file: &str| (file == "hand.obj").then(|| obj.clone().into_bytes());
        let (hulls, unread) = Hulls::of(&urdf, &mut content);
        assert_eq!(unread.into_iter().collect::<Vec<_>>(), ["none.stl"]);
        let links: Vec<&str> = hulls.0.keys().map(String::as_str).collect();
        assert_eq!(links, ["base", "hand", "rod"], "no hull of a link whose mesh is not there, or that has no shape");
        assert_eq!(upper(&hulls.0["base"][0]), [1.0, 2.0, 3.0]);
        let [cylinder, ball] = &hulls.0["rod"][..] else { panic!("two shapes") };
        assert!((upper(cylinder)[2] - 1.0).abs() < 1e-12 && (0.02..0.021).contains(&upper(cylinder)[0]));
        assert!((1.1..1.108).contains(&upper(ball)[2]) && (0.1..0.108).contains(&upper(ball)[0]), "{:?}", upper(ball));
        let hand = &hulls.0["hand"];
        assert!(hand.len() == SLICES && hand.iter().all(|hull| hull.len() < 200));
        // Some hull goes as far as the ball does, in whatever direction.
        for direction in Solid::Ball(1.0).corners() {
            let direction = Vector3::from(direction).normalize();
            let along = hand.iter().flatten().map(|corner| Vector3::from(*corner).dot(&direction)).fold(0.0, f64::max);
            assert!((0.0495..0.054).contains(&along), "{along}");
        }
        // What is written is read again.
        let read = Hulls::parse(&hulls.to_string()).expect("as written");
        assert!((upper(&read.0["hand"][0])[2] - upper(&hand[0])[2]).abs() < 1e-5);
        assert_eq!(read.to_string(), hulls.to_string());
    }

    /// Of a link like an L the corner between its legs is in no hull.
    #[test]
    fn a_bent_mesh_has_hulls_that_leave_its_inside_free() {
        let leg = |sides: [f64; 3]| {
            let corner = |index: usize| [0, 1, 2].map(|side| if index >> side & 1 == 1 { sides[side] } else { 0.0 });
            let sides = [[0, 1, 3], [0, 3, 2], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4], [2, 3, 7], [2, 7, 6]];
            sides.map(|triangle| triangle.map(corner))
        };
        let mesh: Vec<Triangle> = leg([3.0, 1.0, 1.0]).into_iter().chain(leg([0.9, 2.5, 1.0])).collect();
        let slices: Vec<[f64; 3]> = slices(&mesh).iter().map(|hull| upper(hull)).collect();
        assert_eq!(slices, [[1.0, 2.5, 1.0], [2.0, 1.0, 1.0], [3.0, 1.0, 1.0]]);
    }

    #[test]
    fn what_is_no_hull_is_refused_with_its_place() {
        for (text, said) in [
            ("", "EOF while parsing a value at line 1 column 0"),
            ("{\"a\": [[[1, 2]]]}", "invalid length 2, expected an array of length 3 at line 1 column 14"),
            ("{\"a\": [[]]}", "a hull of link `a` has no corner"),
            ("[1]", "invalid type: sequence, expected a map at line 1 column 0"),
        ] {
            assert_eq!(Hulls::parse(text).expect_err(text), said);
        }
        assert_eq!(Hulls::parse("{}"), Ok(Hulls::default()));
    }
}
