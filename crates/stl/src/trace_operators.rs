//! Sliding minima and maxima, and until, in O(1) per sample for any window.
//!
//! Every kernel is written once for both extrema. [`Extremum::Dual`] is the other
//! extremum of the pair. Values are never NaN, so a comparison and a select are
//! enough and compile to a single instruction. Values are never −0 either. Equal
//! values therefore have equal bits, and the order of comparisons has no effect.

/// Minimum or maximum.
pub(crate) trait Extremum {
    /// Other extremum of the pair.
    type Dual: Extremum;
    /// Extremum of no values.
    const NEUTRAL: f64;
    fn pick(a: f64, b: f64) -> f64;
}

pub(crate) struct Min;
pub(crate) struct Max;

impl Extremum for Min {
    type Dual = Max;
    const NEUTRAL: f64 = f64::INFINITY;

    #[inline(always)]
    fn pick(a: f64, b: f64) -> f64 {
        if a < b { a } else { b }
    }
}

impl Extremum for Max {
    type Dual = Min;
    const NEUTRAL: f64 = f64::NEG_INFINITY;

    #[inline(always)]
    fn pick(a: f64, b: f64) -> f64 {
        if b < a { a } else { b }
    }
}

/// Returns the opposite value. A plain minus would turn 0 into −0.
#[inline(always)]
pub(crate) fn opposite(value: f64) -> f64 {
    0.0 - value
}

/// Returns the extremum of all values.
pub(crate) fn fold<E: Extremum>(values: &[f64]) -> f64 {
    // Independent lanes, so that the loop runs in vector registers. The order of
    // extrema does not change the result.
    const LANES: usize = 8;
    let mut lanes = [E::NEUTRAL; LANES];
    let chunks = values.chunks_exact(LANES);
    let rest = chunks.remainder();
    for chunk in chunks {
        for (lane, value) in lanes.iter_mut().zip(chunk) {
            *lane = E::pick(*lane, *value);
        }
    }
    lanes
        .iter()
        .chain(rest)
        .fold(E::NEUTRAL, |a, b| E::pick(a, *b))
}

/// Sets `out[i]` to the extremum of `input[i .. i + width]`, cut at the end.
///
/// Algorithm of van Herk, Gil and Werman. In blocks of `width`, a window is the
/// end of a block and the start of the next. A running extremum backwards and
/// another forwards therefore give all windows.
///
/// `out` is not longer than `input`, and `width` is at least 1.
pub(crate) fn slide<E: Extremum>(input: &[f64], width: usize, out: &mut [f64]) {
    let len = out.len();
    debug_assert!(len <= input.len() && width > 0);
    // Every window reaches the end, so a single backward pass is enough.
    if input.len() <= width {
        return suffix::<E>(input, out);
    }
    // A few passes over everything, each without a branch, are cheaper than
    // blocks.
    if width <= 4 {
        return slide_narrow::<E>(input, width, out);
    }
    // Block 0 runs backwards. Every later block runs forwards for the windows that
    // began in the block before, and backwards for its own, side by side.
    let first = width.min(len);
    suffix::<E>(&input[..width], &mut out[..first]);
    let mut start = width;
    while start < input.len() && start - width < len {
        let block = &input[start..input.len().min(start + width)];
        let (done, rest) = out.split_at_mut(start.min(len));
        let own_len = rest.len().min(block.len());
        let own = &mut rest[..own_len];
        // Windows i = start − width + 1 .. start end inside this block.
        let open = &mut done[start - width + 1..];
        forwards_and_backwards::<E>(block, open, own);
        start += width;
    }
}

/// Runs both passes over a block.
///
/// `open[i] ⊕= extremum of block[..= i]`, `own[i] = extremum of block[i ..]`.
///
/// Each extremum depends on the previous, but the two directions do not
/// depend on each other. A loop over both takes little longer than either alone.
fn forwards_and_backwards<E: Extremum>(block: &[f64], open: &mut [f64], own: &mut [f64]) {
    let mut forward = E::NEUTRAL;
    let mut backward = E::NEUTRAL;
    // Beyond the requested part, the backward pass only updates its extremum.
    let (ours, beyond) = block.split_at(own.len());
    for value in beyond.iter().rev() {
        backward = E::pick(backward, *value);
    }
    let both = open.len().min(block.len()).min(own.len());
    let (open_both, open_rest) = open.split_at_mut(both);
    let split = own.len() - both;
    let (own_rest, own_both) = own.split_at_mut(split);
    let side_by_side = open_both.iter_mut().zip(&block[..both]);
    let mirrored = own_both.iter_mut().rev().zip(ours[split..].iter().rev());
    for ((open, ahead), (own, behind)) in side_by_side.zip(mirrored) {
        forward = E::pick(forward, *ahead);
        *open = E::pick(*open, forward);
        backward = E::pick(backward, *behind);
        *own = backward;
    }
    for (own, behind) in own_rest.iter_mut().zip(&ours[..split]).rev() {
        backward = E::pick(backward, *behind);
        *own = backward;
    }
    // The last block may be short: windows that reach its end are cut there.
    let mut ahead = block[both..].iter();
    for open in open_rest {
        if let Some(value) = ahead.next() {
            forward = E::pick(forward, *value);
        }
        *open = E::pick(*open, forward);
    }
}

fn slide_narrow<E: Extremum>(input: &[f64], width: usize, out: &mut [f64]) {
    let len = out.len();
    out.copy_from_slice(&input[..len]);
    for ahead in 1..width {
        for (out, value) in out.iter_mut().zip(&input[ahead..]) {
            *out = E::pick(*out, *value);
        }
    }
}

/// Sets `out[i]` to the extremum of `input[i ..]`, `out` not longer than `input`.
pub(crate) fn suffix<E: Extremum>(input: &[f64], out: &mut [f64]) {
    // The part behind `out` still belongs to every window.
    let (shown, beyond) = input.split_at(out.len());
    let mut running = fold::<E>(beyond);
    for (out, value) in out.iter_mut().zip(shown).rev() {
        running = E::pick(running, *value);
        *out = running;
    }
}

/// Values of consecutive samples, starting at sample `first`.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    pub(crate) first: usize,
    pub(crate) values: &'a [f64],
}

impl<'a> View<'a> {
    /// Returns the values from sample `from` on, as far as they exist.
    pub(crate) fn from(self, from: usize) -> &'a [f64] {
        let skip = from.saturating_sub(self.first).min(self.values.len());
        &self.values[skip..]
    }

    pub(crate) fn at(self, sample: usize) -> Option<f64> {
        sample
            .checked_sub(self.first)
            .and_then(|i| self.values.get(i))
            .copied()
    }
}

/// Window of samples: `from ..= to` away, or to the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SampleWindow {
    pub(crate) from: usize,
    pub(crate) to: Option<usize>,
}

impl SampleWindow {
    pub(crate) fn width(self) -> Option<usize> {
        self.to.map(|to| to - self.from + 1)
    }
}

/// Continuation behind the last value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WindowTail {
    /// No values, so windows are cut.
    Cut,
    /// The last value, repeated.
    Held,
}

impl WindowTail {
    fn value(self, values: &[f64], neutral: f64) -> f64 {
        match self {
            WindowTail::Cut => neutral,
            WindowTail::Held => values.last().copied().unwrap_or(neutral),
        }
    }
}

/// Always / eventually: the extremum over the window ahead of each sample.
pub(crate) fn ahead<E: Extremum>(
    child: View<'_>,
    window: SampleWindow,
    tail: WindowTail,
    from: usize,
    out: &mut [f64],
) {
    let input = child.from(from + window.from);
    // Windows that begin behind the last value see only the tail.
    let (shown, beyond) = out.split_at_mut(out.len().min(input.len()));
    match window.width() {
        Some(width) => slide::<E>(input, width, shown),
        None => suffix::<E>(input, shown),
    }
    beyond.fill(tail.value(child.values, E::NEUTRAL));
}

/// Historically / once: the extremum over the window behind each sample.
pub(crate) fn behind<E: Extremum>(
    child: View<'_>,
    window: SampleWindow,
    from: usize,
    out: &mut [f64],
) {
    let end = from + out.len();
    // Up to here the window is cut at the start of the trace.
    let cut = window.to.map_or(end, |to| to.min(end)).max(from);
    let (early, late) = out.split_at_mut(cut - from);
    if !early.is_empty() {
        // Cut windows begin at sample 0, so the operand must start there as well.
        debug_assert!(child.first == 0);
        let known = (from + 1)
            .saturating_sub(window.from)
            .min(child.values.len());
        let mut running = fold::<E>(&child.values[..known]);
        let mut next = child.values[known..].iter();
        for (i, out) in early.iter_mut().enumerate() {
            if i != 0
                && window.from <= from + i
                && let Some(value) = next.next()
            {
                running = E::pick(running, *value);
            }
            *out = running;
        }
    }
    if let (Some(to), Some(width), false) = (window.to, window.width(), late.is_empty()) {
        let input = child.from(cut - to);
        slide::<E>(&input[..late.len() + width - 1], width, late);
    }
}

/// `left until right` for `E = Max`, `left release right` for `E = Min`.
///
/// φ U[a,b] ψ = min(G[0,a−1] φ, shift_a(min(F[0,b−a] ψ, φ U ψ))), half-open
/// (Donzé, Ferrère, Maler, "Efficient Robust Monitoring for STL", CAV 2013).
///
/// The bound may be applied separately for this reason. If the best ψ of the
/// unbounded until comes after b, then φ is at least as high up to that ψ. Any ψ
/// before b is then reached as well, and the smaller of the two remains. `work`
/// is a reusable buffer.
pub(crate) fn until<E: Extremum>(
    left: View<'_>,
    right: View<'_>,
    window: SampleWindow,
    tail: WindowTail,
    from: usize,
    out: &mut [f64],
    work: &mut Vec<f64>,
) {
    let start = from + window.from;
    let (input, guard) = (right.from(start), left.from(start));
    let (shown, beyond) = out.split_at_mut(out.len().min(input.len()));
    let mut running = E::NEUTRAL;
    // u(t) = ψ(t) ⊕ (φ(t) ⊗ u(t + 1)), from the end to the beginning.
    let step = |running: f64, guard: f64, goal: f64| E::pick(goal, E::Dual::pick(guard, running));
    // Samples behind `out` only advance the recursion.
    for (guard, goal) in guard.iter().zip(input).skip(shown.len()).rev() {
        running = step(running, *guard, *goal);
    }
    for ((out, guard), goal) in shown.iter_mut().zip(guard).zip(input).rev() {
        running = step(running, *guard, *goal);
        *out = running;
    }
    // A window as wide as the rest of the trace cuts nothing off.
    if let Some(width) = window.width().filter(|width| *width < input.len()) {
        work.resize(shown.len(), 0.0);
        slide::<E>(input, width, work);
        merge::<E::Dual>(shown, work);
    }
    beyond.fill(tail.value(right.values, E::NEUTRAL));
    if window.from != 0 {
        let before = SampleWindow {
            from: 0,
            to: Some(window.from - 1),
        };
        work.resize(out.len(), 0.0);
        ahead::<E::Dual>(left, before, tail, from, work);
        merge::<E::Dual>(out, work);
    }
}

/// `left since right`, the mirror of until, by the mirrored identity.
///
/// The views start at sample 0, except for a bounded window.
pub(crate) fn since(
    left: View<'_>,
    right: View<'_>,
    window: SampleWindow,
    from: usize,
    out: &mut [f64],
    work: &mut Vec<f64>,
) {
    let first = right.first.max(left.first);
    let mut running = f64::NEG_INFINITY;
    let len = out.len();
    // Sample t has the running value of t − a.
    // Before sample a the window is empty, so no goal was seen.
    let empty = window.from.saturating_sub(from).min(len);
    let start = (from + empty).saturating_sub(window.from);
    out[..empty].fill(f64::NEG_INFINITY);
    let mut pairs = left.from(first).iter().zip(right.from(first));
    let step = |running: f64, guard: f64, goal: f64| Max::pick(goal, Min::pick(guard, running));
    // Samples before `start` only advance the recursion.
    for (guard, goal) in pairs.by_ref().take(start.saturating_sub(first)) {
        running = step(running, *guard, *goal);
    }
    for (out, (guard, goal)) in out[empty..].iter_mut().zip(pairs) {
        running = step(running, *guard, *goal);
        *out = running;
    }
    // As in `until`, mirrored: the bounded goal first, then the guard.
    if let Some(width) = window.width() {
        work.resize(len - empty, 0.0);
        let within = SampleWindow {
            from: 0,
            to: Some(width - 1),
        };
        behind::<Max>(right, within, start, work);
        merge::<Min>(&mut out[empty..], work);
    }
    if window.from != 0 {
        let after = SampleWindow {
            from: 0,
            to: Some(window.from - 1),
        };
        work.resize(len, 0.0);
        behind::<Min>(left, after, from, work);
        merge::<Min>(out, work);
    }
}

/// Merges another stretch: `out ⊕= other`.
pub(crate) fn merge<E: Extremum>(out: &mut [f64], other: &[f64]) {
    for (a, b) in out.iter_mut().zip(other) {
        *a = E::pick(*a, *b);
    }
}
