//! What most of many values say, whatever the others are.

/// The middle one of some values in order, of two the greater; `None` of none.
pub fn middle(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// A fit to most of so many items: what is more than `far` times as far from it as the middle item is left out, farthest first and at
/// most `spare` of them, and all others are fitted anew, at most `rounds` times.
pub fn fitted<T>(
    count: usize,
    (far, mut spare, rounds): (f64, usize, usize),
    fit: impl Fn(&[usize]) -> T,
    away: impl Fn(&T, usize) -> f64,
) -> T {
    let mut kept: Vec<usize> = (0..count).collect();
    let mut found = fit(&kept);
    for _ in 0..rounds {
        let mut distances: Vec<(f64, usize)> = kept.iter().map(|item| (away(&found, *item), *item)).collect();
        let Some(middle) = middle(distances.iter().map(|it| it.0).collect()) else { break };
        distances.sort_by(|a, b| b.0.total_cmp(&a.0));
        let left_out = distances.into_iter().take(spare).take_while(|(distance, _)| *distance > far * middle);
        let left_out: Vec<usize> = left_out.map(|(_, item)| item).collect();
        if left_out.is_empty() {
            break;
        }
        spare -= left_out.len();
        kept.retain(|item| !left_out.contains(item));
        found = fit(&kept);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_is_that_of_most() {
        assert_eq!(middle(vec![]), None);
        assert_eq!(middle(vec![3.0, 1e300, 1.0]), Some(3.0));
        assert_eq!(middle(vec![2.0, 1.0]), Some(2.0));
    }

    /// A mean of numbers: what is far off does not move it, as far as that may be left out.
    #[test]
    fn what_is_far_is_left_out_as_far_as_is_allowed() {
        let values = [1.0, 2.0, 3.0, 2.0, 1.0, 3.0, 1.0, 3.0, -9999.0, 1e9];
        let mean = |items: &[usize]| items.iter().map(|item| values[*item]).sum::<f64>() / items.len() as f64;
        let fitted =
            |spare, rounds| fitted(values.len(), (5.0, spare, rounds), mean, |mean, item| (values[item] - mean).abs());
        assert_eq!(fitted(2, 5), 2.0);
        let (all, less): (Vec<usize>, Vec<usize>) = ((0..10).collect(), (0..9).collect());
        assert_eq!((fitted(1, 5), fitted(2, 1), fitted(0, 5)), (mean(&less), mean(&less), mean(&all)));
    }
}
