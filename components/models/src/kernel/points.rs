//! Inputs of a kernel, stored by dimension.

/// Points at which a kernel is evaluated. Coordinates are stored dimension by dimension, so that loops over
/// points access contiguous memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Points {
    dimensions: usize,
    count: usize,
    capacity: usize,
    values: Vec<f64>,
}

impl Points {
    /// Creates points from rows. Each row contains the coordinates of a point.
    ///
    /// # Panics
    /// If the length of `rows` is not a multiple of `dimensions`.
    pub fn from_rows(rows: &[f64], dimensions: usize) -> Self {
        assert!(
            dimensions > 0 && rows.len().is_multiple_of(dimensions),
            "{} values in rows of {dimensions}",
            rows.len()
        );
        let count = rows.len() / dimensions;
        let mut values = vec![0.0; rows.len()];
        for (i, row) in rows.chunks_exact(dimensions).enumerate() {
            for (d, value) in row.iter().enumerate() {
                values[d * count + i] = *value;
            }
        }
        Self { dimensions, count, capacity: count, values }
    }

    /// Returns the number of dimensions of a point.
    pub fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// Returns the number of points.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Returns `true` if there are no points.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Returns one coordinate of all points.
    pub fn coordinate(&self, dimension: usize) -> &[f64] {
        &self.values[dimension * self.capacity..][..self.count]
    }

    /// Returns one coordinate of all points for writing.
    pub fn coordinate_mut(&mut self, dimension: usize) -> &mut [f64] {
        &mut self.values[dimension * self.capacity..][..self.count]
    }

    /// Copies the coordinates of one point to `point`.
    pub fn copy_point(&self, index: usize, point: &mut [f64]) {
        for (d, value) in point.iter_mut().enumerate() {
            *value = self.coordinate(d)[index];
        }
    }

    /// Returns the points row by row. Each row contains the coordinates of a point.
    pub fn to_rows(&self) -> Vec<f64> {
        (0..self.count).flat_map(|i| (0..self.dimensions).map(move |d| self.coordinate(d)[i])).collect()
    }

    /// Appends a point.
    ///
    /// # Panics
    /// If the point has the wrong number of dimensions.
    pub fn push(&mut self, point: &[f64]) {
        assert_eq!(point.len(), self.dimensions, "dimensions of the point");
        if self.count == self.capacity {
            let capacity = (2 * self.capacity).max(8);
            let mut values = vec![0.0; capacity * self.dimensions];
            for d in 0..self.dimensions {
                values[d * capacity..][..self.count].copy_from_slice(self.coordinate(d));
            }
            (self.capacity, self.values) = (capacity, values);
        }
        for (d, value) in point.iter().enumerate() {
            self.values[d * self.capacity + self.count] = *value;
        }
        self.count += 1;
    }

    /// Removes a point and shifts later points down by one index.
    pub fn remove(&mut self, index: usize) {
        for d in 0..self.dimensions {
            self.coordinate_mut(d).copy_within(index + 1.., index);
        }
        self.count -= 1;
    }
}
