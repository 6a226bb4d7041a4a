"""The control systems that ants walk through, as Gymnasium environments."""
