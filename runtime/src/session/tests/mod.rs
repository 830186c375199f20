mod episodes;
mod forks;
