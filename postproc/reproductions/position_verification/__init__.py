"""Position verification as its report describes it: theory, and its table beside ours."""
