//! The keys of `[constraints]`.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

use super::Exactly;

/// The constraints on movements.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Constraints {
    #[serde(default)]
    pub limits_deg: BTreeMap<Spanned<String>, Spanned<Exactly<f64, 2>>>,
    #[serde(default)]
    pub limits_m: BTreeMap<Spanned<String>, Spanned<Exactly<f64, 2>>>,
    #[serde(rename = "box", default)]
    pub boxes: Vec<Spanned<ForbiddenBox>>,
    pub minimum_height_m: Option<Spanned<f64>>,
    pub self_clearance_m: Option<Spanned<f64>>,
    pub allowed_deg: Option<Spanned<Vec<Spanned<Vec<f64>>>>>,
    pub start_deg: Option<Spanned<Vec<f64>>>,
    pub greatest_travel_deg: Option<Spanned<f64>>,
    pub greatest_travel_m: Option<Spanned<f64>>,
    pub travel_price: Option<Spanned<f64>>,
}

/// A box that the robot must keep out of.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForbiddenBox {
    pub name: Spanned<String>,
    pub lower_m: Spanned<Exactly<f64, 3>>,
    pub upper_m: Spanned<Exactly<f64, 3>>,
}
