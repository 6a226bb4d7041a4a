"""Methods that know or measure the model: exact ones to hold the learners against."""
