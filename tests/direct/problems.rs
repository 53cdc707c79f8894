//! The nine test problems, with published figures.

use std::f64::consts::PI;

/// A test problem of Jones, Perttunen and Stuckman (1993).
pub struct Problem {
    pub name: &'static str,
    pub objective: fn(&[f64]) -> f64,
    pub domain: &'static [(f64, f64)],
    pub minimum: f64,
    /// Evaluations until the error is below 10⁻⁴, by DIRECT and by DIRECT-l: Gablonsky's user guide, table 4.
    pub published: [usize; 2],
    /// Orders of the coordinates for which NLopt 2.11.0 (`GN_ORIG_DIRECT`, `GN_ORIG_DIRECT_L`, `magic_eps` 10⁻⁴)
    /// was run as well. It needs the published number of evaluations for every one of them.
    pub orders: &'static [&'static [usize]],
}

/// All nine, in the order of the table.
pub const PROBLEMS: [Problem; 9] = [
    Problem {
        name: "Branin",
        objective: branin,
        domain: &[(-5.0, 10.0), (0.0, 15.0)],
        minimum: 0.397_887_357_729_738_16,
        published: [195, 159],
        orders: &[&[0, 1], &[1, 0]],
    },
    Problem {
        name: "Shekel-5",
        objective: |x| shekel(5, x),
        domain: &[(0.0, 10.0); 4],
        minimum: -10.153_199_679_058_2,
        published: [155, 147],
        orders: &[&[0, 1, 2, 3], &[3, 2, 1, 0], &[1, 2, 3, 0], &[2, 0, 3, 1]],
    },
    Problem {
        name: "Shekel-7",
        objective: |x| shekel(7, x),
        domain: &[(0.0, 10.0); 4],
        minimum: -10.402_940_566_818_7,
        published: [145, 141],
        orders: &[&[0, 1, 2, 3], &[3, 2, 1, 0], &[1, 2, 3, 0], &[2, 0, 3, 1]],
    },
    Problem {
        name: "Shekel-10",
        objective: |x| shekel(10, x),
        domain: &[(0.0, 10.0); 4],
        minimum: -10.536_409_816_692,
        published: [145, 139],
        orders: &[&[0, 1, 2, 3], &[3, 2, 1, 0], &[1, 2, 3, 0], &[2, 0, 3, 1]],
    },
    Problem {
        name: "Hartman-3",
        objective: |x| hartman(&HARTMAN_3, x),
        domain: &[(0.0, 1.0); 3],
        minimum: -3.862_782_147_820_76,
        published: [199, 111],
        orders: &[&[0, 1, 2], &[2, 1, 0], &[1, 2, 0]],
    },
    Problem {
        name: "Hartman-6",
        objective: |x| hartman(&HARTMAN_6, x),
        domain: &[(0.0, 1.0); 6],
        minimum: -3.322_368_011_415_51,
        published: [571, 295],
        orders: &[&[0, 1, 2, 3, 4, 5], &[5, 4, 3, 2, 1, 0], &[1, 2, 3, 4, 5, 0], &[3, 0, 5, 1, 4, 2]],
    },
    Problem {
        name: "Goldstein–Price",
        objective: goldstein_price,
        domain: &[(-2.0, 2.0); 2],
        minimum: 3.0,
        published: [191, 115],
        orders: &[&[0, 1], &[1, 0]],
    },
    Problem {
        name: "six-hump camel",
        objective: six_hump_camel,
        domain: &[(-3.0, 3.0), (-2.0, 2.0)],
        minimum: -1.031_628_453_489_877_4,
        published: [285, 191],
        orders: &[&[0, 1], &[1, 0]],
    },
    Problem {
        name: "Shubert",
        objective: shubert,
        domain: &[(-10.0, 10.0); 2],
        minimum: -186.730_908_831_024,
        published: [2967, 2043],
        orders: &[&[0, 1], &[1, 0]],
    },
];

impl Problem {
    /// The problem over the unit cube, whose coordinate k stands for the problem's coordinate `order[k]`.
    pub fn over_the_cube<'a>(&'a self, order: &'a [usize]) -> impl Fn(&[f64]) -> f64 + 'a {
        |unit| {
            let mut x = vec![0.0; unit.len()];
            for (&coordinate, unit) in order.iter().zip(unit) {
                let (low, high) = self.domain[coordinate];
                x[coordinate] = low + (high - low) * unit;
            }
            (self.objective)(&x)
        }
    }
}

pub fn branin(x: &[f64]) -> f64 {
    let parabola = x[1] - 5.1 / (4.0 * PI * PI) * x[0] * x[0] + 5.0 / PI * x[0] - 6.0;
    parabola * parabola + 10.0 * (1.0 - 1.0 / (8.0 * PI)) * x[0].cos() + 10.0
}

fn shekel(terms: usize, x: &[f64]) -> f64 {
    const WELLS: [([f64; 4], f64); 10] = [
        ([4.0, 4.0, 4.0, 4.0], 0.1),
        ([1.0, 1.0, 1.0, 1.0], 0.2),
        ([8.0, 8.0, 8.0, 8.0], 0.2),
        ([6.0, 6.0, 6.0, 6.0], 0.4),
        ([3.0, 7.0, 3.0, 7.0], 0.4),
        ([2.0, 9.0, 2.0, 9.0], 0.6),
        ([5.0, 5.0, 3.0, 3.0], 0.3),
        ([8.0, 1.0, 8.0, 1.0], 0.7),
        ([6.0, 2.0, 6.0, 2.0], 0.5),
        ([7.0, 3.6, 7.0, 3.6], 0.5),
    ];
    let term = |&(centre, width): &([f64; 4], f64)| {
        let distance: f64 = x.iter().zip(centre).map(|(x, centre)| (x - centre).powi(2)).sum();
        1.0 / (distance + width)
    };
    -WELLS[..terms].iter().map(term).sum::<f64>()
}

/// Weight, rates and centre of each well.
type Hartman<const N: usize> = [(f64, [f64; N], [f64; N]); 4];

const HARTMAN_3: Hartman<3> = [
    (1.0, [3.0, 10.0, 30.0], [0.3689, 0.117, 0.2673]),
    (1.2, [0.1, 10.0, 35.0], [0.4699, 0.4387, 0.747]),
    (3.0, [3.0, 10.0, 30.0], [0.1091, 0.8732, 0.5547]),
    (3.2, [0.1, 10.0, 35.0], [0.03815, 0.5743, 0.8828]),
];

const HARTMAN_6: Hartman<6> = [
    (1.0, [10.0, 3.0, 17.0, 3.5, 1.7, 8.0], [0.1312, 0.1696, 0.5569, 0.0124, 0.8283, 0.5886]),
    (1.2, [0.05, 10.0, 17.0, 0.1, 8.0, 14.0], [0.2329, 0.4135, 0.8307, 0.3736, 0.1004, 0.9991]),
    (3.0, [3.0, 3.5, 1.7, 10.0, 17.0, 8.0], [0.2348, 0.1451, 0.3522, 0.2883, 0.3047, 0.6650]),
    (3.2, [17.0, 8.0, 0.05, 10.0, 0.1, 14.0], [0.4047, 0.8828, 0.8732, 0.5743, 0.1091, 0.0381]),
];

fn hartman<const N: usize>(wells: &Hartman<N>, x: &[f64]) -> f64 {
    let well = |(weight, rates, centre): &(f64, [f64; N], [f64; N])| {
        let exponent: f64 = (0..N).map(|k| rates[k] * (x[k] - centre[k]).powi(2)).sum();
        weight * (-exponent).exp()
    };
    -wells.iter().map(well).sum::<f64>()
}

pub fn goldstein_price(x: &[f64]) -> f64 {
    let (x, y) = (x[0], x[1]);
    let near = 19.0 - 14.0 * x + 3.0 * x * x - 14.0 * y + 6.0 * x * y + 3.0 * y * y;
    let far = 18.0 - 32.0 * x + 12.0 * x * x + 48.0 * y - 36.0 * x * y + 27.0 * y * y;
    (1.0 + (x + y + 1.0).powi(2) * near) * (30.0 + (2.0 * x - 3.0 * y).powi(2) * far)
}

fn six_hump_camel(x: &[f64]) -> f64 {
    let (x, y) = (x[0], x[1]);
    (4.0 - 2.1 * x * x + x.powi(4) / 3.0) * x * x + x * y + (4.0 * y * y - 4.0) * y * y
}

pub fn shubert(x: &[f64]) -> f64 {
    let factor = |x: &f64| (1..=5).map(f64::from).map(|j| j * ((j + 1.0) * x + j).cos()).sum::<f64>();
    x.iter().map(factor).product()
}
