//! Counts of heap allocations.

/// Counts the heap allocations of a call in the calling thread, except those within
/// [`set_apart`](crate::telemetry::set_apart).
///
/// ```
/// motorium::count_allocations!();
///
/// # fn main() {
/// assert_eq!(motorium::testing::allocations(|| 1 + 1), 0);
/// assert_eq!(motorium::testing::allocations(|| vec![1, 2, 3]), 1);
/// # }
/// ```
///
/// # Panics
/// If the test program lacks [`count_allocations!`](crate::count_allocations).
pub fn allocations<R>(call: impl FnOnce() -> R) -> u64 {
    assert!(
        crate::telemetry::counts_allocations(),
        "this program does not count its allocations: write `motorium::count_allocations!();` at its top"
    );
    let before = crate::telemetry::allocations().own;
    let result = core::hint::black_box(call());
    let count = crate::telemetry::allocations().own - before;
    drop(result);
    count
}

/// Makes a program count its heap allocations, for [`testing::allocations`](crate::testing::allocations) and
/// for the `allocations` of each component in a report. Use this macro once per program.
#[macro_export]
macro_rules! count_allocations {
    () => {
        #[global_allocator]
        static ALLOCATOR: $crate::telemetry::CountingAllocator = $crate::telemetry::CountingAllocator;
    };
}
