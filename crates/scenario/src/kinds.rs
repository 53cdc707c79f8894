//! The estimators and policies that a scenario can name.

/// The estimators that a scenario can name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EstimatorKind {
    /// Recursive least squares.
    Rls,
    /// Recursive least squares by the unscented transform.
    Unscented,
    /// Recursive least squares in the paper's six numbers per joint: a comparison, which shows no covariance.
    #[serde(rename = "rls-six-numbers")]
    OverparameterisedRls,
    /// Stochastic gradient.
    Gradient,
    /// Maximum a posteriori over all measurements, with several hypotheses.
    Smoother,
}

impl EstimatorKind {
    /// All estimators.
    pub const ALL: [Self; 5] = [Self::Rls, Self::Unscented, Self::OverparameterisedRls, Self::Gradient, Self::Smoother];

    /// Its name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rls => "rls",
            Self::Unscented => "unscented",
            Self::OverparameterisedRls => "rls-six-numbers",
            Self::Gradient => "gradient",
            Self::Smoother => "smoother",
        }
    }

    /// Whether it keeps a covariance, by which active selection chooses and a learner settles.
    pub fn keeps_covariance(self) -> bool {
        matches!(self, Self::Rls | Self::Unscented | Self::Smoother)
    }
}

/// The policies that a scenario can name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PolicyKind {
    /// Minimises the A-criterion; where a head watches, weighted by the chance of being seen.
    Active,
    /// Minimises the A-criterion as if the predicted marker were always seen: a comparison where a head watches.
    ActiveNaive,
    /// Plans several movements together, as many as are still needed; `active` with a smoother.
    ActivePlanned,
    /// Like `active`, but by original DIRECT, whatever the scenario's variant.
    ActiveDirect,
    /// Like `active`, but by the best of as many random configurations: the baseline of every search.
    ActiveRandomSearch,
    /// Like `active`, but by Bayesian optimisation with as many evaluations.
    ActiveBayesian,
    /// Like `active`, but with the expectation of (7) by Monte Carlo over the posterior.
    ActiveMonteCarlo,
    /// Draws uniformly.
    Random,
    /// Waits for a person to choose. No file names it: every simulated scenario offers it.
    Human,
}

impl PolicyKind {
    /// All policies.
    pub const ALL: [Self; 9] = [
        Self::Active,
        Self::ActiveNaive,
        Self::ActivePlanned,
        Self::ActiveDirect,
        Self::ActiveRandomSearch,
        Self::ActiveBayesian,
        Self::ActiveMonteCarlo,
        Self::Random,
        Self::Human,
    ];

    /// Its name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Active => "active",
            Self::ActiveNaive => "active-naive",
            Self::ActivePlanned => "active-planned",
            Self::ActiveDirect => "active-direct",
            Self::ActiveRandomSearch => "active-random-search",
            Self::ActiveBayesian => "active-bayesian",
            Self::ActiveMonteCarlo => "active-monte-carlo",
            Self::Random => "random",
            Self::Human => "human",
        }
    }

    /// Whether it is `Active` with another search of the joint box; over recorded rows these are all equal.
    pub(super) fn varies_the_search(self) -> bool {
        matches!(
            self,
            Self::ActiveNaive
                | Self::ActiveDirect
                | Self::ActiveRandomSearch
                | Self::ActiveBayesian
                | Self::ActiveMonteCarlo
        )
    }
}
