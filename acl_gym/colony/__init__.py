"""What a colony is made of: pheromone, choices, solutions, costs and deposits."""
