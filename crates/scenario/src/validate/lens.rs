//! The lens of a camera: the size of its picture, its intrinsics and its distortion, in keys of a scenario or in those of ROS's `camera_info`.

use std::ops::Range;

use toml::Spanned;

use super::{Check, raw};
use body_schema_engine::{
    elementary::sin_cos,
    model::{Distortion, DistortionModel},
    numeric_range::{are_usable, is_not_negative, is_positive},
};

/// The lens of a camera.
pub(super) struct Lens {
    pub size_px: [f64; 2],
    /// fx, fy, cx, cy, pixels.
    pub intrinsics: [f64; 4],
    pub distortion: Option<Distortion>,
    /// The prior standard deviation of each coefficient; 0 of one that is held.
    pub learned: Vec<f64>,
}

/// The share of the picture's smaller side up to which a distortion must hold, from the centre.
const HOLDS: f64 = 0.25;

/// The names of the models, as scenarios and ROS write them; `None` is a pinhole.
const MODELS: [(&str, Option<DistortionModel>); 7] = [
    ("pinhole", None),
    ("brown_conrady", Some(DistortionModel::BrownConrady)),
    ("plumb_bob", Some(DistortionModel::BrownConrady)),
    ("rational_polynomial", Some(DistortionModel::BrownConrady)),
    ("fisheye", Some(DistortionModel::Equidistant)),
    ("equidistant", Some(DistortionModel::Equidistant)),
    ("kannala_brandt", Some(DistortionModel::Equidistant)),
];

impl Check<'_> {
    /// The lens of a camera whose table is at `span`.
    pub(super) fn lens(&mut self, key: &str, raw: &raw::Camera, span: Range<usize>) -> Lens {
        let size_px = self.size(key, raw, &span);
        let model = self.model(key, raw);
        let intrinsics = self.intrinsics(key, raw, size_px, model, &span);
        let (distortion, learned) = self.distortion(key, raw, model);
        if let Some(lens) = &distortion {
            self.check_reach(key, raw, lens, &intrinsics, size_px);
        }
        // A lens that does not bend light is a pinhole, unless that is to be learned.
        let is_straight = |lens: &Distortion| {
            lens.model() == DistortionModel::BrownConrady && lens.coefficients().iter().all(|k| *k == 0.0)
        };
        let distortion = distortion.filter(|lens| !is_straight(lens) || learned.iter().any(|sd| *sd > 0.0));
        Lens { size_px, intrinsics, distortion, learned }
    }

    /// Refuses all but the first of several keys that say the same.
    fn only_one(&mut self, key: &str, given: &[(&str, Option<Range<usize>>)]) {
        let mut said = given.iter().filter_map(|(name, span)| Some((*name, span.clone()?)));
        let Some((first, _)) = said.next() else { return };
        for (name, span) in said {
            let what = format!("beside `{first}`, which says it too");
            self.problem(span, format!("{key}.{name}"), what, format!("remove `{name}`, or `{first}`"));
        }
    }

    fn positive_pair(&mut self, key: &str, pair: [f64; 2], span: Range<usize>) -> [f64; 2] {
        if !pair.iter().all(|x| is_positive(*x)) {
            self.problem(span, key, format!("{pair:?} is out of range"), "write two numbers above 0, in pixels");
        }
        pair
    }

    fn size(&mut self, key: &str, raw: &raw::Camera, span: &Range<usize>) -> [f64; 2] {
        let field = |field: &str| format!("{key}.{field}");
        let sides = [("image_width", &raw.image_width), ("image_height", &raw.image_height)];
        for (name, side) in sides {
            self.only_one(
                key,
                &[("size_px", raw.size_px.as_ref().map(Spanned::span)), (name, side.as_ref().map(Spanned::span))],
            );
        }
        if let Some(size) = &raw.size_px {
            let raw::Exactly(pair) = *size.get_ref();
            return self.positive_pair(&field("size_px"), pair, size.span());
        }
        if let [(_, Some(width)), (_, Some(height))] = sides {
            return [self.positive(&field("image_width"), width), self.positive(&field("image_height"), height)];
        }
        let hint = "add `size_px = [width, height]`, in pixels, or `image_width` and `image_height`";
        self.problem(span.clone(), field("size_px"), "missing", hint);
        [1.0; 2]
    }

    /// The model that the camera names; of Brown and Conrady, where it names none.
    fn model(&mut self, key: &str, raw: &raw::Camera) -> Option<DistortionModel> {
        let given = [("model", &raw.model), ("distortion_model", &raw.distortion_model)];
        self.only_one(key, &given.map(|(name, value)| (name, value.as_ref().map(Spanned::span))));
        let Some((name, value)) = given.into_iter().find_map(|(name, value)| Some((name, value.as_ref()?))) else {
            return Some(DistortionModel::BrownConrady);
        };
        let found = MODELS.iter().find(|(word, _)| word == value.get_ref());
        if found.is_none() {
            let words: Vec<&str> = MODELS.iter().map(|(word, _)| *word).collect();
            let what = format!("there is no model of lenses `{}`", value.get_ref());
            self.problem(value.span(), format!("{key}.{name}"), what, format!("write one of {}", words.join(", ")));
        }
        found.map_or(Some(DistortionModel::BrownConrady), |(_, model)| *model)
    }

    fn intrinsics(
        &mut self,
        key: &str,
        raw: &raw::Camera,
        size_px: [f64; 2],
        model: Option<DistortionModel>,
        span: &Range<usize>,
    ) -> [f64; 4] {
        let field = |field: &str| format!("{key}.{field}");
        let matrices = [("camera_matrix", &raw.camera_matrix), ("K", &raw.k)];
        let matrix = matrices.iter().find_map(|(name, matrix)| Some((*name, matrix.as_ref()?)));
        let spans = matrices.map(|(name, matrix)| (name, matrix.as_ref().map(Spanned::span)));
        let (focal, fov) = (raw.focal_px.as_ref().map(Spanned::span), raw.fov_deg.as_ref().map(Spanned::span));
        self.only_one(key, &[("focal_px", focal), ("fov_deg", fov), spans[0].clone(), spans[1].clone()]);
        if let Some((name, matrix)) = matrix {
            self.only_one(
                key,
                &[(name, Some(matrix.span())), ("centre_px", raw.centre_px.as_ref().map(Spanned::span))],
            );
            return self.camera_matrix(&field(name), matrix);
        }
        let [cx, cy] = match &raw.centre_px {
            Some(centre) => {
                let raw::Exactly(pair) = *centre.get_ref();
                self.positive_pair(&field("centre_px"), pair, centre.span())
            }
            None => size_px.map(|side| 0.5 * side),
        };
        let [fx, fy] = match (&raw.focal_px, &raw.fov_deg) {
            (Some(focal), _) => {
                let pair = match *focal.get_ref() {
                    raw::Focal::Both(both) => [both; 2],
                    raw::Focal::Each(raw::Exactly(pair)) => pair,
                };
                self.positive_pair(&field("focal_px"), pair, focal.span())
            }
            (None, Some(fov)) => {
                let is_fisheye = model == Some(DistortionModel::Equidistant);
                let (most, hint) = match is_fisheye {
                    true => (
                        360.0,
                        "an angle above 0 and below 360 degrees, from the left side of the picture to the right",
                    ),
                    false => (
                        180.0,
                        "an angle above 0 and below 180 degrees, from the left side of the picture to the right",
                    ),
                };
                let half = 0.5 * self.number(&field("fov_deg"), fov, |x| x > 0.0 && x < most, hint).to_radians();
                let (sine, cosine) = sin_cos(half);
                let reach = if is_fisheye { half } else { sine / cosine };
                [0.5 * size_px[0] / reach; 2]
            }
            (None, None) => {
                let hint = "add `focal_px = [fx, fy]`, in pixels, `fov_deg = …` from the left side of the picture to the right, or \
                            `camera_matrix`";
                self.problem(span.clone(), field("focal_px"), "missing", hint);
                [1.0; 2]
            }
        };
        [fx, fy, cx, cy]
    }

    /// fx, fy, cx, cy of a matrix [fx, 0, cx, 0, fy, cy, 0, 0, 1].
    fn camera_matrix(&mut self, key: &str, matrix: &Spanned<raw::Matrix>) -> [f64; 4] {
        let numbers = matrix.get_ref().numbers();
        let hint = "write [fx, 0, cx, 0, fy, cy, 0, 0, 1], in pixels";
        let [fx, skew, cx, below, fy, cy, last @ ..] = numbers.as_slice() else {
            self.problem(matrix.span(), key, format!("has {} numbers instead of 9", numbers.len()), hint);
            return [1.0; 4];
        };
        let what = match last {
            _ if numbers.len() != 9 => format!("has {} numbers instead of 9", numbers.len()),
            _ if *skew != 0.0 => format!("has a skew of {skew}: the axes of pictures are taken to be at right angles"),
            [0.0, 0.0, 1.0] if *below == 0.0 && are_usable(&numbers) && is_positive(*fx) && is_positive(*fy) => {
                return [*fx, *fy, *cx, *cy];
            }
            _ => "is no camera matrix".to_owned(),
        };
        self.problem(matrix.span(), key, what, hint);
        [1.0; 4]
    }

    /// The distortion, and the prior deviations of its coefficients.
    fn distortion(
        &mut self,
        key: &str,
        raw: &raw::Camera,
        model: Option<DistortionModel>,
    ) -> (Option<Distortion>, Vec<f64>) {
        let field = |field: &str| format!("{key}.{field}");
        let of = |matrix: &Spanned<raw::Matrix>| (matrix.span(), matrix.get_ref().numbers());
        let given = [
            ("distortion", raw.distortion.as_ref().map(|list| (list.span(), list.get_ref().clone()))),
            ("distortion_coefficients", raw.distortion_coefficients.as_ref().map(of)),
            ("D", raw.d.as_ref().map(of)),
        ];
        let spans = given.each_ref().map(|(name, value)| (*name, value.as_ref().map(|(span, _)| span.clone())));
        self.only_one(key, &spans);
        let found = given.into_iter().find_map(|(name, value)| Some((name, value?)));
        let learned_to = raw.learn_distortion_to.as_ref();
        let Some(model) = model else {
            let is_bent = |(_, (_, list)): &(&str, (Range<usize>, Vec<f64>))| list.iter().any(|k| *k != 0.0);
            let bent = found.filter(is_bent).map(|(name, (span, _))| (name, span));
            let learned = learned_to.map(|it| ("learn_distortion_to", it.span()));
            for (name, span) in bent.into_iter().chain(learned) {
                self.problem(
                    span,
                    field(name),
                    "a pinhole has no distortion",
                    "write another `model`, or remove this key",
                );
            }
            return (None, Vec::new());
        };
        let names = model.names();
        let lists = match model {
            DistortionModel::BrownConrady => {
                "[k1, k2, p1, p2], [k1, k2, p1, p2, k3] or [k1, k2, p1, p2, k3, k4, k5, k6]"
            }
            DistortionModel::Equidistant => "[k1, k2, k3, k4]",
        };
        let hint = format!("write {lists}, in OpenCV's order");
        let usual = || vec![0.0; if model == DistortionModel::BrownConrady { 5 } else { 4 }];
        let each = learned_to.and_then(|it| match it.get_ref() {
            raw::OneOrEach::Each(list) => Some(vec![0.0; list.len()]),
            raw::OneOrEach::One(_) => None,
        });
        let is_fisheye = model == DistortionModel::Equidistant;
        let (name, span, mut list) = match found {
            // ROS writes a camera without distortion with an empty list.
            Some((_, (_, list))) if list.is_empty() && learned_to.is_none() && !is_fisheye => {
                return (None, Vec::new());
            }
            Some((name, (span, list))) if !list.is_empty() => (name, span, list),
            _ => match learned_to {
                Some(it) => ("learn_distortion_to", it.span(), each.unwrap_or_else(usual)),
                None if is_fisheye => ("model", 0..0, usual()),
                None => return (None, Vec::new()),
            },
        };
        // Twelve and fourteen of them are those of thin prisms and tilted sensors too.
        while list.len() > names.len() && list.last() == Some(&0.0) {
            list.pop();
        }
        let Some(distortion) = Distortion::new(model, &list) else {
            let what = match list.len() {
                count if model.takes(count) => "a coefficient is no number that can be computed with".to_owned(),
                count if count > names.len() => {
                    format!("has {count} coefficients; more than {} are not known", names.len())
                }
                count => format!("has {count} coefficients"),
            };
            self.problem(span, field(name), what, hint);
            return (None, Vec::new());
        };
        let learned =
            learned_to.map_or_else(Vec::new, |it| self.deviations_of(&field("learn_distortion_to"), it, list.len()));
        (Some(distortion), learned)
    }

    fn deviations_of(&mut self, key: &str, given: &Spanned<raw::OneOrEach>, count: usize) -> Vec<f64> {
        let deviations = match given.get_ref() {
            raw::OneOrEach::One(sd) => vec![*sd; count],
            raw::OneOrEach::Each(list) => list.clone(),
        };
        if deviations.len() != count {
            let what = format!("{} deviations for {count} coefficients", deviations.len());
            self.problem(given.span(), key, what, "write one number, or one for each of them");
        }
        if let Some(sd) = deviations.iter().find(|sd| !is_not_negative(**sd)) {
            let hint = "write numbers above 0, or 0 for a coefficient that is known";
            self.problem(given.span(), key, format!("{sd} is out of range"), hint);
        }
        deviations
    }

    /// Refuses a distortion that ends to hold long before the sides of the picture.
    fn check_reach(
        &mut self,
        key: &str,
        raw: &raw::Camera,
        lens: &Distortion,
        intrinsics: &[f64; 4],
        size_px: [f64; 2],
    ) {
        let reach = lens.reach() * intrinsics[0].min(intrinsics[1]);
        if reach >= HOLDS * size_px[0].min(size_px[1]) || !reach.is_finite() {
            return;
        }
        let lists = [raw.distortion_coefficients.as_ref(), raw.d.as_ref()];
        let spans = lists.into_iter().flatten().map(Spanned::span);
        let Some(span) = raw.distortion.as_ref().map(Spanned::span).into_iter().chain(spans).next() else { return };
        let what = format!("this lens folds the picture over, {reach:.0} px from its centre");
        let hint =
            "check the order, k1, k2, p1, p2, k3, the model, and that focal lengths are of pictures of this size";
        self.problem(span, format!("{key}.distortion"), what, hint);
    }
}

#[cfg(test)]
mod tests {
    use body_schema_engine::model::{Block, DistortionModel};

    use crate::{Known, Scenario, builtin};

    /// The shipped scenario of a camera with other keys in place of its lens.
    fn parsed(keys: &str) -> Result<Scenario, String> {
        let shipped = builtin("arm-6dof-camera").expect("built in");
        let lens = "size_px = [640.0, 480.0]\nfocal_px = [500.0, 500.0]\n";
        assert!(shipped.source.contains(lens));
        let text = shipped.source.replacen(lens, &format!("{keys}\n"), 1);
        Scenario::parse("lens.toml", &text, &|_| Err("no data".to_owned())).map_err(|error| error.to_string())
    }

    fn device(keys: &str) -> body_schema_engine::model::Device {
        parsed(keys).unwrap_or_else(|error| panic!("{keys}: {error}")).robot.state.devices[0].clone()
    }

    /// The same lens, in keys of scenarios and of ROS.
    #[test]
    fn a_lens_is_written_in_keys_of_its_own_or_of_ros() {
        let plain = device("size_px = [640, 480]\nfocal_px = [500, 500]");
        assert_eq!((plain.intrinsics, plain.distortion), (Some([500.0, 500.0, 320.0, 240.0]), None));
        for same in [
            "size_px = [640, 480]\nfocal_px = 500",
            "image_width = 640\nimage_height = 480\nK = [500, 0, 320, 0, 500, 240, 0, 0, 1]",
            "image_width = 640\nimage_height = 480\nk = [[500, 0, 320], [0, 500, 240], [0, 0, 1]]\nd = []",
            "size_px = [640, 480]\nfocal_px = 500\nmodel = \"pinhole\"\ndistortion = [0, 0, 0, 0, 0]",
            "image_width = 640\nimage_height = 480\ncamera_matrix = { rows = 3, cols = 3, data = [500, 0, 320, 0, 500, 240, 0, 0, 1] }\n\
             distortion_model = \"plumb_bob\"\ndistortion_coefficients = { rows = 1, cols = 5, data = [0, 0, 0, 0, 0] }",
        ] {
            assert_eq!(device(same), plain, "{same}");
        }
        let [fx, ..] = device("size_px = [640, 480]\nfov_deg = 60").intrinsics.expect("a lens");
        assert!((fx - 320.0 * 3_f64.sqrt()).abs() < 1e-9);
        let fisheye = device("size_px = [640, 480]\nfov_deg = 180\nmodel = \"fisheye\"");
        let [fx, ..] = fisheye.intrinsics.expect("a lens");
        assert!((fx * std::f64::consts::FRAC_PI_2 - 320.0).abs() < 1e-9);
        assert_eq!(fisheye.distortion.expect("a fisheye").coefficients(), [0.0; 4]);
        let bent = device("size_px = [640, 480]\nfocal_px = 500\ndistortion = [-0.3, 0.1, 0.001, -0.002, 0.02]");
        let distortion = bent.distortion.expect("a lens");
        assert_eq!(
            (distortion.model(), distortion.written()),
            (DistortionModel::BrownConrady, &[-0.3, 0.1, 0.001, -0.002, 0.02][..])
        );
        let rational = "distortion_model = \"rational_polynomial\"\nD = [0.4, -0.3, 0, 0, 0, 0.7, -0.1, 0, 0, 0, 0, 0]";
        let rational = device(&format!("size_px = [640, 480]\nfocal_px = 500\n{rational}")).distortion.expect("a lens");
        assert_eq!(rational.coefficients(), [0.4, -0.3, 0.0, 0.0, 0.0, 0.7, -0.1, 0.0]);
    }

    /// Coefficients are learned one by one, with their deviations.
    #[test]
    fn coefficients_are_learned_one_by_one() {
        let learned = |keys: &str| {
            let scenario = parsed(&format!("size_px = [640, 480]\nfocal_px = 500\n{keys}")).expect("valid");
            let deviation = |block: Block| match scenario.prior.of(block) {
                Some(Known::Within { other, .. }) => other,
                _ => 0.0,
            };
            let blocks = scenario.robot.layout.blocks().map(|(block, _)| block);
            let of = |block: Block| matches!(block, Block::Distortion(..)).then(|| (block, deviation(block)));
            blocks.filter_map(of).collect::<Vec<_>>()
        };
        let all = |count: usize, sd: f64| (0..count).map(|index| (Block::Distortion(0, index), sd)).collect::<Vec<_>>();
        assert_eq!(learned("learn_distortion_to = 0.05"), all(5, 0.05));
        assert_eq!(learned("distortion = [0, 0, 0, 0]\nlearn_distortion_to = 0.05"), all(4, 0.05));
        assert_eq!(learned("model = \"fisheye\"\nlearn_distortion_to = 0.02"), all(4, 0.02));
        let one = learned("distortion = [-0.3, 0, 0, 0, 0]\nlearn_distortion_to = [0.1, 0, 0, 0, 0.2]");
        assert_eq!(one, [(Block::Distortion(0, 0), 0.1), (Block::Distortion(0, 4), 0.2)]);
    }

    #[test]
    fn what_contradicts_itself_is_refused_with_a_hint() {
        let size = "size_px = [640, 480]\n";
        let pinhole = "size_px = [640, 480]\nfocal_px = 500\n";
        for (before, keys, key, hint) in [
            ("", "focal_px = 500", "camera[0].size_px", "add `size_px = [width, height]`"),
            ("", "image_width = 640\nfocal_px = 500", "camera[0].size_px", "`image_width` and `image_height`"),
            (pinhole, "image_width = 640", "camera[0].image_width", "remove `image_width`, or `size_px`"),
            (size, "", "camera[0].focal_px", "`fov_deg = …`"),
            (pinhole, "fov_deg = 60", "camera[0].fov_deg", "remove `fov_deg`, or `focal_px`"),
            (pinhole, "K = [500, 0, 320, 0, 500, 240, 0, 0, 1]", "camera[0].K", "remove `K`, or `focal_px`"),
            (
                size,
                "centre_px = [3, 4]\nK = [500, 0, 320, 0, 500, 240, 0, 0, 1]",
                "camera[0].centre_px",
                "remove `centre_px`",
            ),
            (size, "K = [500, 2, 320, 0, 500, 240, 0, 0, 1]", "camera[0].K", "write [fx, 0, cx"),
            (size, "K = [500, 0, 320]", "camera[0].K", "write [fx, 0, cx"),
            (size, "K = [500, 0, 320, 0, 500, 240, 0, 0, 2]", "camera[0].K", "write [fx, 0, cx"),
            (size, "fov_deg = 180", "camera[0].fov_deg", "below 180 degrees"),
            (size, "focal_px = \"wide\"", "camera[0].focal_px", "one number, or two"),
            (size, "focal_px = [0, 500]", "camera[0].focal_px", "two numbers above 0"),
            (pinhole, "distortion = [0.1, 0.2]", "camera[0].distortion", "[k1, k2, p1, p2, k3]"),
            (pinhole, "distortion = [0.1, 0, 0, nan]", "camera[0].distortion", "in OpenCV's order"),
            (pinhole, "distortion = [0, 0, 0, 0, 0, 0, 0, 0, 0.1]", "camera[0].distortion", "in OpenCV's order"),
            (pinhole, "distortion = [0.1, 0, 0, 0]\nD = [0.1, 0, 0, 0]", "camera[0].D", "remove `D`, or `distortion`"),
            (pinhole, "distortion = [0.1, 0.05, 30.0, 0]", "camera[0].distortion", "check the order"),
            (pinhole, "model = \"fish\"", "camera[0].model", "write one of pinhole"),
            (pinhole, "model = \"pinhole\"\ndistortion = [0.1, 0, 0, 0]", "camera[0].distortion", "another `model`"),
            (
                pinhole,
                "model = \"fisheye\"\ndistortion = [0.1, 0, 0, 0, 0.1]",
                "camera[0].distortion",
                "[k1, k2, k3, k4]",
            ),
            (
                pinhole,
                "model = \"fisheye\"\ndistortion_model = \"equidistant\"",
                "camera[0].distortion_model",
                "remove",
            ),
            (pinhole, "learn_distortion_to = -0.1", "camera[0].learn_distortion_to", "numbers above 0, or 0"),
            (
                pinhole,
                "distortion = [0, 0, 0, 0]\nlearn_distortion_to = [0.1]",
                "camera[0].learn_distortion_to",
                "one for each",
            ),
            (pinhole, "k1 = 0.1", "camera[0].k1", "write `distortion = [k1, k2, p1, p2, k3]`"),
        ] {
            let error = parsed(&format!("{before}{keys}")).map(|_| ()).expect_err(keys);
            assert!(error.contains(key) && error.contains(hint), "{keys}: {error}");
        }
    }

    /// Targets that are seen point by point.
    #[test]
    fn points_may_be_seen_one_by_one() {
        let shipped = builtin("arm-6dof-camera").expect("built in");
        let facing = "facing = [0.0, 0.0, 1.0]\nfacing_within_deg = 80.0\n";
        assert!(shipped.source.contains(facing));
        let parsed = |keys: &str| {
            let text = shipped.source.replacen(facing, &format!("{keys}\n"), 1);
            Scenario::parse("points.toml", &text, &|_| Err("no data".to_owned())).map_err(|error| error.to_string())
        };
        let all = "points_facing = [[0, 0, 1], [0, 0, 1], [1, 0, 0], [0, 1, 0]]";
        let scenario =
            parsed(&format!("partly_seen = true\nleast_points = 2\nfacing_within_deg = 70\n{all}")).expect("valid");
        let seen = scenario.robot.equipment.targets[0].partly_seen.clone().expect("point by point");
        assert_eq!((seen.least_points, seen.facing.len()), (2, 4));
        assert!((seen.facing[3].within - 70_f64.to_radians()).abs() < 1e-12);
        assert_eq!(scenario.measurement_model.sensors()[0].subject().least_points, Some(2));
        assert_eq!(
            parsed("partly_seen = false").expect("valid").measurement_model.sensors()[0].subject().least_points,
            None
        );
        for (keys, key, hint) in [
            (all, "target[0].points_facing", "add `partly_seen = true`"),
            ("least_points = 2", "target[0].least_points", "add `partly_seen = true`"),
            ("partly_seen = true\nleast_points = 5", "target[0].least_points", "from 1 to 4"),
            ("partly_seen = true\nleast_points = 0", "target[0].least_points", "from 1 to 4"),
            ("partly_seen = true\npoints_facing = [[0, 0, 1]]", "target[0].points_facing", "one direction for each"),
            (
                "partly_seen = true\npoints_facing = [[0, 0, 1], [0, 0, 1], [0, 0, 2], [0, 0, 1]]",
                "target[0].points_facing",
                "unit vector",
            ),
            (&format!("partly_seen = true\nfacing = [0, 0, 1]\n{all}"), "target[0].points_facing", "remove `facing`"),
            ("partly_seen = true\nfacing_within_deg = 70", "target[0].facing_within_deg", "add `points_facing`"),
        ] {
            let error = parsed(keys).map(|_| ()).expect_err(keys);
            assert!(error.contains(key) && error.contains(hint), "{keys}: {error}");
        }
    }
}
