use super::*;

#[test]
fn first_sample_has_twice_the_time_and_at_least_half_a_second() {
    let seconds = |stop: &Stop<'_>| {
        let limit = stop.limit.as_ref().expect("a limit");
        1e-9 * limit.length.load(Ordering::Relaxed) as f64
    };
    // Instants between the deadline and its evaluation only shorten the time.
    for (time, first) in [(100.0, 200.0), (0.0, 0.5)] {
        let deadline = Instant::now() + Duration::from_secs_f64(time);
        let stop = Stop::at(None, Some(deadline), true);
        assert!(seconds(&stop) <= first && seconds(&stop) > 0.9 * first);
        stop.end_first_sample();
        assert!(seconds(&stop) <= time && seconds(&stop) >= 0.9 * time);
        let resumed = Stop::at(None, Some(deadline), false);
        assert!(seconds(&resumed) <= time && seconds(&resumed) >= 0.9 * time);
    }
}
