//! Suggestions of movements, and their states.

use std::{collections::BTreeMap, fmt};

use serde::{Deserialize, Serialize, Serializer, ser::SerializeStruct};

/// A suggested movement. As JSON its `configuration` lists the joints in the order of `joints`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Suggestion {
    /// Its id, counted from 1 over all clients.
    pub id: u64,
    /// The number of events that the session had when it was chosen.
    pub revision: u64,
    /// The client that it is for; null if the client gave no name.
    #[serde(default)]
    pub client: Option<String>,
    /// The names of the joints, base first: the order in which lists of positions are written.
    #[serde(default)]
    pub joints: Vec<String>,
    /// The positions to move to, by joint name, in the units of the URDF (rad, m).
    pub configuration: BTreeMap<String, f64>,
    /// The socket that the target is to be held in, such as `PLACE/NAME`; null without sockets.
    #[serde(default)]
    pub socket: Option<String>,
    /// The expected fall of the criterion, in its own units; null for a policy without one, and for a movement that was given
    /// in advance, such as the first into a socket.
    pub expected_gain: Option<f64>,
    /// The expected mean error of predictions over the workspace after it and all that were pending before it,
    /// millimetres; null for an estimator without a covariance.
    pub expected_error_mm_after: Option<f64>,
    /// The chance that anything is seen, 0 to 1.
    pub chance_seen: f64,
    /// The distance that the joint with the longest way moves, from where the robot will stand then, rad (or m); null if
    /// that is unknown.
    pub travel_rad: Option<f64>,
    /// Its state.
    pub state: SuggestionState,
    /// The time of its expiry, seconds since 1970; null if it does not expire.
    #[serde(default)]
    pub expires_at_s: Option<f64>,
}

impl Serialize for Suggestion {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { id, revision, client, joints, configuration, socket, .. } = self;
        let Self { expected_gain, expected_error_mm_after, chance_seen, travel_rad, state, expires_at_s, .. } = self;
        let mut fields = serializer.serialize_struct("Suggestion", 12)?;
        fields.serialize_field("id", id)?;
        fields.serialize_field("revision", revision)?;
        fields.serialize_field("client", client)?;
        fields.serialize_field("joints", joints)?;
        fields.serialize_field("configuration", &InOrder { joints, configuration })?;
        fields.serialize_field("socket", socket)?;
        fields.serialize_field("expected_gain", expected_gain)?;
        fields.serialize_field("expected_error_mm_after", expected_error_mm_after)?;
        fields.serialize_field("chance_seen", chance_seen)?;
        fields.serialize_field("travel_rad", travel_rad)?;
        fields.serialize_field("state", state)?;
        fields.serialize_field("expires_at_s", expires_at_s)?;
        fields.end()
    }
}

/// A configuration with its joints written in this order, so that programs that take an object's values in the order of their
/// text have them base first.
struct InOrder<'a> {
    joints: &'a [String],
    configuration: &'a BTreeMap<String, f64>,
}

impl Serialize for InOrder<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { joints, configuration } = self;
        let named = joints.iter().filter_map(|name| configuration.get_key_value(name));
        let others = configuration.iter().filter(|(name, _)| !joints.contains(name));
        serializer.collect_map(named.chain(others))
    }
}

/// The state of a suggestion; see the [module](super).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum SuggestionState {
    /// It waits to be carried out.
    Pending,
    /// An observation names it.
    Observed,
    /// An observation names it, and no channel had a reading.
    NotSeen,
    /// The robot cannot go there.
    Infeasible,
    /// It will not be carried out.
    Abandoned,
    /// Another suggestion takes its place.
    Superseded,
    /// Its time ran out.
    Expired,
}

impl fmt::Display for SuggestionState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Pending => "pending",
            Self::Observed => "observed",
            Self::NotSeen => "not_seen",
            Self::Infeasible => "infeasible",
            Self::Abandoned => "abandoned",
            Self::Superseded => "superseded",
            Self::Expired => "expired",
        })
    }
}

/// The report that a suggestion is not carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The robot cannot go there.
    Infeasible,
    /// It will not be carried out.
    Abandoned,
}

impl From<Outcome> for SuggestionState {
    fn from(outcome: Outcome) -> Self {
        match outcome {
            Outcome::Infeasible => Self::Infeasible,
            Outcome::Abandoned => Self::Abandoned,
        }
    }
}

/// A request for suggestions.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct Ask {
    /// The number of pending suggestions that the client wants to have; 1 by default.
    #[serde(deserialize_with = "crate::integer::integer_or_none")]
    #[cfg_attr(feature = "openapi", schema(minimum = 1, maximum = 20))]
    pub count: Option<u64>,
    /// The client's name.
    #[cfg_attr(feature = "openapi", schema(min_length = 1, max_length = 100))]
    pub client: Option<String>,
    /// Whether the client's pending suggestions are replaced.
    pub replan: bool,
    /// Postures that somebody wants, by joint name (rad, m): each becomes a pending suggestion, in their order, after those that are pending
    /// and before any that is chosen.
    #[cfg_attr(feature = "openapi", schema(max_items = 20))]
    pub wanted: Vec<BTreeMap<String, f64>>,
    /// How long new suggestions stay pending, seconds; for ever by default.
    #[cfg_attr(feature = "openapi", schema(exclusive_minimum = 0.0))]
    pub expires_s: Option<f64>,
}

/// A client's pending suggestions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Suggestions {
    /// The suggestions, in the order in which they were chosen.
    pub suggestions: Vec<Suggestion>,
    /// Present once no more observations are needed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enough: Option<Enough>,
}

/// The wanted accuracy is reached: the agent's expected error of predictions has been below it for five movements.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Enough {
    /// The expected mean error of predictions over the workspace now, millimetres.
    pub expected_error_mm: f64,
    /// The wanted accuracy, millimetres.
    pub wanted_mm: f64,
    /// The number of observations behind it, excluded ones not counted.
    pub observations: u64,
}
