//! Derivative-free minimisation over the unit cube: DIRECT and its locally biased form DIRECT-l.
//!
//! [`Direct`] is the ask-and-tell minimiser and [`minimize`] the loop around it; nothing in them is random. For
//! comparison there is [`bayesian()`], Bayesian optimisation with a Gaussian process. [`polish()`] finishes what they began;
//! [`descend`] does so from many points, with gradients. Nothing in this module knows what is being minimised.
//!
//! # Algorithm
//!
//! The cube [0, 1]ⁿ is divided into hyperrectangles, here called rectangles, each evaluated at its centre c. Every side
//! has a trisection level l and is 3⁻ˡ long. An iteration
//!
//! 1. **chooses** the potentially optimal rectangles j of size dⱼ and value fⱼ, those for which some rate K > 0 has
//!
//!    ```text
//!    fⱼ − K dⱼ ≤ fᵢ − K dᵢ          for every rectangle i,
//!    fⱼ − K dⱼ ≤ fmin − ε |fmin|.
//!    ```
//!
//!    They are vertices of the lower right convex [hull](Direct::hull) of the points (d, f);
//! 2. **samples**, for each of them, the points c ± 3⁻ˡ⁻¹ eᵢ on all of its longest sides i, l being their level;
//! 3. **divides** it into thirds along those sides, by increasing wᵢ = min f(c ± 3⁻ˡ⁻¹ eᵢ), so that the best samples
//!    become the centres of the largest rectangles.
//!
//! The two variants differ in how they measure a rectangle, and in what they do about equals:
//!
//! | | [`Original`](Variant::Original) | [`LocallyBiased`](Variant::LocallyBiased) |
//! |---|---|---|
//! | size d | centre to corner, ½ √(9⁻ˡ¹ + … + 9⁻ˡⁿ) | half the longest side, ½ 3⁻ˡ |
//! | of rectangles equal in d and f | divides all | divides one |
//!
//! # Order and ties
//!
//! Results depend on the order in which equals are served, so it is fixed, and follows Gablonsky's code:
//!
//! * The best rectangle of every chosen size comes first, from the largest size to the smallest; then, in the
//!   original variant, those that tie with it, again from the largest size to the smallest. With
//!   [`smallest_first`](Settings::smallest_first) it is the other way round, as in NLopt's code; with that and without ε
//!   DIRECT-l finds what NLopt's `GN_DIRECT_L` finds by as many evaluations (`benches/choosing`, `-- --least`).
//! * Rectangles equal in size and value are served first come, first served. Children come in the order of their
//!   sides, plus before minus, and are followed by their parent.
//! * In the original variant, values of one size tie with the best if they exceed it by 10⁻¹³ at most. This is an
//!   absolute figure: symmetric points differ by rounding errors, and the published counts rest on treating them
//!   alike (with exact ties the six-hump camel function takes 201 evaluations, not 285). An objective of a very
//!   different scale is better rescaled first. All other comparisons are exact.
//! * Sides equal in wᵢ are divided in the order of coordinates, points of equal value rank by age, and points in the
//!   interior of a hull edge count as vertices. Of rectangles equal in value but not in size only the largest is a
//!   vertex.
//!
//! # Infeasible centres
//!
//! An objective need not be defined everywhere: a value that is not finite marks its centre as infeasible. Such a
//! rectangle takes part with a surrogate value (Gablonsky's guide, §3.5). With F the feasible centres inside the
//! rectangle of the same centre and double its sides, borders included, it is
//!
//! ```text
//! m + 10⁻⁶ |m| with m = min f(F)         if F is not empty,
//! 1 + max f over all feasible centres    otherwise, and at most,
//! ```
//!
//! and is brought up to date after every iteration, as F gains new samples and loses others when the rectangle is
//! divided. So a rectangle next to a good point is divided soon, and one amid others like it waits. While nothing
//! feasible is known there are no values to compare, and an iteration divides the eldest of the largest rectangles.
//!
//! # Limits
//!
//! Centres lie on a ternary lattice and are correctly rounded, however deep. A side at [`MAX_LEVEL`] is not divided
//! any further; a rectangle all of whose sides are there stays in the partition, but no longer takes part. With
//! ε > 0 and a minimum other than zero, rectangles hardly ever become that small.
//!
//! Choosing takes time in proportion to the number of different sizes, not rectangles; filing a rectangle takes
//! O(log N). Surrogates are found by descending the tree of divisions, and cost nothing if every centre is feasible.
//!
//! # Agreement with published results
//!
//! With ε = 10⁻⁴ both variants need exactly as many evaluations for the nine test problems of Jones et al. as the
//! user guide reports, and as NLopt's `GN_ORIG_DIRECT` and `GN_ORIG_DIRECT_L` do; the integration tests hold the
//! table. The known deviations from Gablonsky's code are these:
//!
//! * The [budget](Direct#budget) is strict. Gablonsky's code completes the last iteration, and keeps going until it
//!   has found a feasible point.
//! * Centres are correctly rounded, not accumulated. The difference, a few units in the last place, shows where
//!   three points of the hull diagram lie on a line but for rounding, as with sums of |xᵢ − aᵢ|.
//! * The depth is limited as said above.
//! * First come, first served has no exception. In his sorted lists a sample whose value equals the former best of its
//!   size goes before that, if its twin on the same side is better still.
//! * ε is fixed; his optional rule for updating it is left out.
//! * Surrogates are compared like any values. Gablonsky's code does not hold rectangles with nothing feasible nearby
//!   against others, and so may divide several sizes of them at once. The published counts involve no infeasible
//!   centres, and say nothing about this part.
//!
//! # Sources
//!
//! * D. R. Jones, C. D. Perttunen and B. E. Stuckman. Lipschitzian optimization without the Lipschitz constant.
//!   *Journal of Optimization Theory and Applications* 79 (1993), 157–181.
//! * J. M. Gablonsky and C. T. Kelley. A locally-biased form of the DIRECT algorithm. *Journal of Global Optimization*
//!   21 (2001), 27–37.
//! * J. M. Gablonsky. DIRECT version 2.0 user guide. Technical report CRSC-TR01-08, North Carolina State University,
//!   2001. His code, in the C translation that NLopt distributes, served as the reference for order and ties.

mod bayesian;
mod descent;
mod direct;
mod minimum;
mod polish;
mod quasi_newton;

pub use bayesian::bayesian;
pub use descent::{Slopes, descend};
pub use minimum::Minimum;
pub use minimum::least;
pub use polish::{Differences, Polish, polish};

pub use direct::{
    Batch, CoordinatePerturbations, Direct, DirectError, Division, History, HullPoint, MAX_LEVEL, Moment, Plane,
    Projection, Rectangle, Settings, Shape, Variant, contains, minimize,
};
