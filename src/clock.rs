//! Time as a count of nominal steps and their binary fractions. It does not drift, and halved steps end where whole steps do.

use serde::{Deserialize, Serialize};

/// The most times a step can be halved.
pub(crate) const MAX_HALVINGS: u32 = 20;

/// Ticks per nominal step.
const TICKS: u64 = 1 << MAX_HALVINGS;

/// The tolerance for round-off in an end time, in steps.
const TIME_TOLERANCE: f64 = 1e-6;

/// The part of a clock that changes in a run. Checkpoints store it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Reached {
    /// Time since the start, in ticks of Δt / 2^[`MAX_HALVINGS`].
    ticks: u64,
    /// The current step is Δt / 2^level.
    level: u32,
    /// Steps taken.
    steps: u64,
}

impl Reached {
    /// Steps taken.
    pub(crate) fn steps(&self) -> u64 {
        self.steps
    }
}

/// The time of a run, and the length of its steps.
///
/// ```
/// use bfree::clock::Clock;
///
/// let mut clock = Clock::new(0.1, 20);
/// for _ in 0..1000 {
///     clock.advance();
/// }
/// // No drift: a sum of a thousand steps of 0.1 is not 100.
/// assert_eq!((clock.time(), clock.steps()), (100.0, 1000));
/// assert_ne!((0..1000).map(|_| 0.1).sum::<f64>(), 100.0);
/// // A halved step counts as one step, and as half of the time.
/// assert!(clock.halve());
/// clock.advance();
/// assert_eq!((clock.step(), clock.nominal()), (0.05, 0.1));
/// assert_eq!((clock.steps(), clock.nominal_steps(), clock.on_nominal()), (1001, 1000, false));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    nominal: f64,
    max_halvings: u32,
    /// The end time of a clock from [`Clock::to`], which has a single nominal step.
    end: Option<f64>,
    reached: Reached,
}

impl Clock {
    /// At time zero, with nominal step `dt`, which may be halved `max_halvings` times (at most 20).
    pub fn new(dt: f64, max_halvings: u32) -> Self {
        Self { nominal: dt, max_halvings: max_halvings.min(MAX_HALVINGS), end: None, reached: Reached::default() }
    }

    /// The steps and the time reached.
    pub(crate) fn reached(&self) -> Reached {
        self.reached
    }

    /// This clock, set to what another clock with the same nominal step has reached. `None` if this clock cannot reach it.
    pub(crate) fn at(self, reached: Reached) -> Option<Self> {
        let Reached { ticks, level, .. } = reached;
        // The limit is far below an overflow of the ticks, and far above any number of steps.
        let possible = level <= self.max_halvings && ticks < 1 << 62 && ticks.is_multiple_of(TICKS >> level);
        possible.then_some(Self { reached, ..self })
    }

    /// t_n
    pub fn time(&self) -> f64 {
        // The time is exact while the number of steps is, because whole steps and the fraction are each multiplied once.
        let (whole, part) = ((self.reached.ticks / TICKS) as f64, (self.reached.ticks % TICKS) as f64 / TICKS as f64);
        match self.end {
            Some(end) => end + (whole - 1.0) * self.nominal + part * self.nominal,
            None => whole * self.nominal + part * self.nominal,
        }
    }

    /// Δt of the coming step.
    pub fn step(&self) -> f64 {
        self.nominal / (1_u64 << self.reached.level) as f64
    }

    /// The nominal Δt.
    pub fn nominal(&self) -> f64 {
        self.nominal
    }

    /// The number of whole steps until `end`. A step that misses `end` by less than a millionth of a step has reached it.
    pub(crate) fn whole_steps(&self, end: f64) -> u64 {
        (end / self.nominal + TIME_TOLERANCE).floor().max(0.0) as u64
    }

    /// The time left to `end` after [`Self::whole_steps`], if `end` lies between steps.
    pub(crate) fn rest(&self, end: f64) -> Option<f64> {
        let rest = end - self.whole_steps(end) as f64 * self.nominal;
        (rest > TIME_TOLERANCE * self.nominal).then_some(rest)
    }

    /// Whether `end` is reached, to within a millionth of a step.
    ///
    /// ```
    /// use bfree::clock::Clock;
    ///
    /// let mut clock = Clock::new(0.1, 0);
    /// (0..3).for_each(|_| clock.advance());
    /// assert!(clock.has_reached(0.3) && !clock.has_reached(0.31));
    /// ```
    pub fn has_reached(&self, end: f64) -> bool {
        end - self.time() <= TIME_TOLERANCE * self.nominal
    }

    /// A clock whose nominal step is the time left to `end`. This step is halved until it is no longer than the coming step. `None` if
    /// `end` is reached, to within a millionth of a step, or is more than a nominal step away.
    ///
    /// ```
    /// use bfree::clock::Clock;
    ///
    /// let mut clock = Clock::new(0.1, 5);
    /// clock.advance();
    /// let mut last = clock.to(0.13).ok_or("between steps")?;
    /// assert_eq!((last.time(), last.nominal_steps(), last.steps()), (0.1, 0, 1));
    /// last.advance();
    /// assert_eq!((last.time(), last.nominal_steps(), last.steps()), (0.13, 1, 2));
    /// assert!(clock.to(0.1).is_none() && clock.to(0.25).is_none());
    /// # Ok::<(), &str>(())
    /// ```
    pub fn to(&self, end: f64) -> Option<Self> {
        let rest = end - self.time();
        let between = rest > TIME_TOLERANCE * self.nominal && rest < self.nominal;
        let level = (0..self.max_halvings).find(|&level| rest <= self.step() * (1_u64 << level) as f64);
        let level = level.unwrap_or(self.max_halvings);
        let reached = Reached { ticks: 0, level, ..self.reached };
        between.then_some(Self { nominal: rest, end: Some(end), reached, ..*self })
    }

    /// Steps taken so far.
    pub fn steps(&self) -> u64 {
        self.reached.steps
    }

    /// Nominal steps completed.
    pub fn nominal_steps(&self) -> u64 {
        self.reached.ticks / TICKS
    }

    /// Whether t_n is a multiple of the nominal step.
    pub fn on_nominal(&self) -> bool {
        self.reached.ticks.is_multiple_of(TICKS)
    }

    /// Moves to t_{n+1}. A halved step doubles as soon as t_{n+1} is a multiple of the doubled step.
    pub fn advance(&mut self) {
        self.advance_and_grow_if(true);
    }

    /// Moves to t_{n+1} like [`Self::advance`], but a halved step doubles only if it `may`.
    pub(crate) fn advance_and_grow_if(&mut self, may: bool) {
        self.reached.ticks += TICKS >> self.reached.level;
        self.reached.steps += 1;
        if may && self.reached.level > 0 && self.reached.ticks.is_multiple_of(TICKS >> (self.reached.level - 1)) {
            self.reached.level -= 1;
        }
    }

    /// Whether the step can be halved once more.
    pub(crate) fn can_halve(&self) -> bool {
        self.reached.level < self.max_halvings
    }

    /// Halves the step; `false` if the limit is reached.
    ///
    /// ```
    /// use bfree::clock::Clock;
    ///
    /// let mut clock = Clock::new(0.1, 2);
    /// assert!(clock.halve());
    /// clock.advance();
    /// assert_eq!((clock.time(), clock.step()), (0.05, 0.05));
    /// clock.advance();
    /// assert_eq!((clock.time(), clock.step()), (0.1, 0.1)); // back on whole steps
    /// ```
    pub fn halve(&mut self) -> bool {
        let possible = self.can_halve();
        self.reached.level += u32::from(possible);
        possible
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halved_steps_end_where_whole_ones_do_and_grow_back() {
        let mut clock = Clock::new(0.1, 3);
        clock.advance();
        assert!(clock.halve() && clock.halve());
        let mut lengths = Vec::new();
        while !(clock.on_nominal() && clock.nominal_steps() == 2) {
            lengths.push(clock.step());
            clock.advance();
        }
        // ¼ ¼ then ½: the step grows when it fits, and the time is that of two whole steps
        assert_eq!(lengths, [0.025, 0.025, 0.05]);
        assert_eq!((clock.time(), clock.step(), clock.steps()), (0.2, 0.1, 4));
    }

    #[test]
    fn a_clock_continues_where_another_has_come_to() {
        let mut clock = Clock::new(0.1, 3);
        clock.advance();
        clock.halve();
        clock.halve();
        clock.advance();
        let mut again = Clock::new(0.1, 3).at(clock.reached());
        for _ in 0..5 {
            assert_eq!(again, Some(clock));
            clock.advance();
            again.iter_mut().for_each(Clock::advance);
        }
        // halved more often than allowed, and in the middle of a step
        let (level, steps) = (2, 2);
        assert_eq!(Clock::new(0.1, 1).at(Reached { ticks: 5 * (TICKS >> 2), level, steps }), None);
        assert_eq!(Clock::new(0.1, 3).at(Reached { ticks: TICKS >> 3, level, steps }), None);
    }

    #[test]
    fn a_step_that_may_not_grow_stays_short_and_grows_where_it_fits() {
        let mut clock = Clock::new(1.0, 3);
        assert!(clock.halve() && clock.halve());
        let lengths: Vec<f64> = [false, false, false, true, true, true]
            .map(|may| {
                let dt = clock.step();
                clock.advance_and_grow_if(may);
                dt
            })
            .into();
        // Four quarters fill a nominal step. From there on the step doubles when it is allowed to.
        assert_eq!(lengths, [0.25, 0.25, 0.25, 0.25, 0.5, 0.5]);
        assert_eq!((clock.time(), clock.step()), (2.0, 1.0));
    }

    /// A step whose whole length failed is not tried in that length again.
    #[test]
    fn the_way_to_an_end_between_steps_is_as_short_as_the_coming_step() {
        let mut clock = Clock::new(1.0, 3);
        assert!(clock.halve() && clock.halve());
        clock.advance();
        // 0.85 is left, in quarters of it.
        let last = clock.to(1.1).unwrap();
        assert_eq!((last.step(), last.time()), (0.25 * (1.1 - 0.25), 0.25));
        // If less is left than the coming step, the last step takes all of it.
        assert_eq!(clock.to(0.4).unwrap().step(), 0.4 - 0.25);
    }

    #[test]
    fn the_limit_on_halvings_holds() {
        let mut clock = Clock::new(1.0, 2);
        assert_eq!([clock.halve(), clock.halve(), clock.halve()], [true, true, false]);
        assert_eq!(clock.step(), 0.25);
    }

    #[test]
    fn what_a_clock_has_reached_goes_through_a_file() -> Result<(), serde_json::Error> {
        let mut clock = Clock::new(0.1, 2);
        clock.advance();
        clock.advance();
        let read: Reached = serde_json::from_str(&serde_json::to_string(&clock.reached())?)?;
        assert_eq!((read.steps(), Clock::new(0.1, 2).at(read)), (2, Some(clock)));
        Ok(())
    }

    #[test]
    fn whole_steps_and_the_rest_lead_to_the_end() {
        // 0.3 / 0.1 is 2.9999999999999996.
        assert_eq!([0.3, 0.39].map(|end| Clock::new(0.1, 0).whole_steps(end)), [3, 3]);
        assert_eq!((Clock::new(0.25, 0).rest(0.625), Clock::new(0.1, 0).rest(0.3)), (Some(0.125), None));
    }
}
