/* Body force of the expanding ring, P. Wallstedt and J. Guilkey (slides, closing listing), as Maple printed it but
   for numbers and names that the slides break across lines. R and H are the polar coordinates. */
t1 = pi*pi;
t3 = 1/rho;
t4 = t1*E*t3;
t5 = R*R;
t6 = t5*R;
t8 = c2*t5;
t9 = c1*R;
t11 = T*(c3*t6+t8+t9);
t12 = cos(H);
t17 = T*T;
t18 = t17*T;
t19 = c2*c2;
t20 = t19*t19;
t27 = c3*c3;
t31 = T*c2;
t34 = t17*c2;
t35 = c1*c1;
t39 = t35*c1;
t42 = t27*t27;
t44 = t5*t5;
t48 = t19*c2;
t52 = t27*c3;
t54 = t44*R;
t57 = t18*t27;
t61 = t18*t52;
t66 = t18*c3;
t77 = t5*c1;
t80 =
12.0*t18*t20*t6+19.0*T*t19*R+68.0*T*t27*t6+12.0*t31*c1+9.0*t34*t35+3.0*t18*c2*t39+72.0*t18
*t42*t44*t6+24.0*t17*t48*t5+120.0*t17*t52*t54+191.0*t57*
t54*t19+195.0*t61*t44*t5*c2+8.0*t66*R*t39+56.0*t57*t6*t35+80.0*t66*t44*t48+24.0
*t18*t48*t77;
t82 = R*t35;
t88 = t17*c3;
t89 = t6*t19;
t94 = t17*t27;
t98 = t44*c2;
t101 = t17*t19;
t104 = T*c3;
t124 =
15.0*t18*t19*t82+120.0*t61*t54*c1+130.0*t88*t89+24.0*t88*t82+112.0*t94
*t6*c1+221.0*t94*t98+30.0*t101*t9+32.0*t104*t9+76.0*t104*t8+6.0*c2+122.0*
t88*t8*c1+61.0*t66*t8*t35+130.0*t66
*t89*c1+221.0*t57*t98*c1+16.0*c3*R;
t125 = t80+t124;
t127 = t104*t5;
t129 = t31*R;
t131 = T*c1;
t151 =
1/(3.0*t127+2.0*t129+1.0+t131)/(1.0
+3.0*t94*t44+5.0*t88*t6*c2+4.0*
t88*t77+3.0*t34*t9+t17*t35+2.0*t131
+2.0*t101*t5+3.0*t129+4.0*t127);
t156 = sin(H);
b[0] = -t4*t11*t12-
t3*E*T*t12*t125*t151/2.0;
b[1] = -t4*t11*t156-
t3*t125*E*T*t156*t151/2.0;
b[2] = 0.0;
