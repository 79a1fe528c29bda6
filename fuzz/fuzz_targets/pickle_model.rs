//! Fuzzes the reader of models from Python pickles.
#![no_main]

condyle_fuzz::target!(condyle_fuzz::Kind::Pickle);
