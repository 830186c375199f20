//! The motorium runtime: components as real-time processes that share state
