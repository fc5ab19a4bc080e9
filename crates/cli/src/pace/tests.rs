use super::*;
use std::thread::sleep;

const WORK: Duration = Duration::from_millis(60);

#[test]
fn slow_work_takes_a_fifth_at_most() {
    let mut pace = Pace::at_once(Duration::from_millis(1));
    assert!(pace.is_due() && !Pace::after(Duration::from_secs(60)).is_due());
    let (begun, mut spent, mut times) = (Instant::now(), Duration::ZERO, 0);
    while times < 3 {
        if pace.is_due() {
            let clock = Instant::now();
            pace.spend(|| sleep(WORK));
            spent += clock.elapsed();
            times += 1;
        }
        sleep(Duration::from_millis(1));
    }
    // There is no pause after the last work.
    assert!(begun.elapsed() >= spent + 2 * REST * WORK, "{spent:?}");
}

#[test]
fn quick_work_is_due_after_its_interval() {
    let mut pace = Pace::after(Duration::from_millis(20));
    assert!(!pace.is_due());
    sleep(Duration::from_millis(30));
    assert!(pace.is_due());
    pace.spend(|| ());
    assert!(!pace.is_due());
}
