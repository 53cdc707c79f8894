//! One random stream for each purpose, so that drawing more of one thing changes nothing else.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// What a stream of random numbers is for. The numbers are part of what makes a seed reproducible: never renumber.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// The error of the initial estimate.
    InitialEstimate = 1,
    /// The measurement noise, one draw per movement.
    Noise = 2,
    /// The choices of a policy, each keyed by its ordinal.
    Policy = 3,
    /// The configurations of the prediction error.
    Evaluation = 4,
    /// The configurations over which a learner judges itself.
    Workspace = 5,
    /// The rows of a data set that are held out.
    HeldOut = 6,
    /// Where a smoother searches for hypotheses.
    Hypotheses = 7,
    /// Which readings are outliers, and where they lie; one draw per movement.
    Outliers = 8,
    /// The postures that hold a target in sockets that are held out.
    HeldOutSockets = 9,
    /// The error of what is known before any movement.
    Beforehand = 10,
    /// What the joints' readings are off by, one draw per movement.
    JointNoise = 11,
}

impl Stream {
    /// The numbers of one item of this purpose, by its ordinal: each has 2³² words of the stream to itself.
    pub fn keyed(self, seed: u64, ordinal: u64) -> ChaCha8Rng {
        let mut rng = self.rng(seed);
        rng.set_word_pos(u128::from(ordinal) << 32);
        rng
    }

    /// The stream of this purpose under a seed (ChaCha with 8 rounds).
    pub fn rng(self, seed: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(self as u64);
        rng
    }
}
