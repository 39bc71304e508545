C     Compressible neo-Hookean solid as a UMAT, in fixed form.
C     Energy: mu/2 (tr C - 3 - 2 ln J) + lambda/2 (ln J)**2.
C     PROPS: lambda, mu. No STATEV. NTENS is 6 or 4.
C     DDSDDE: Jaumann rate of the Kirchhoff stress over J.
      SUBROUTINE UMAT(STRESS,STATEV,DDSDDE,SSE,SPD,SCD,
     1 RPL,DDSDDT,DRPLDE,DRPLDT,
     2 STRAN,DSTRAN,TIME,DTIME,TEMP,DTEMP,PREDEF,DPRED,CMNAME,
     3 NDI,NSHR,NTENS,NSTATV,PROPS,NPROPS,COORDS,DROT,PNEWDT,
     4 CELENT,DFGRD0,DFGRD1,NOEL,NPT,LAYER,KSPT,JSTEP,KINC)
      INCLUDE 'ABA_PARAM.INC'
      CHARACTER*80 CMNAME
      DIMENSION STRESS(NTENS),STATEV(NSTATV),
     1 DDSDDE(NTENS,NTENS),DDSDDT(NTENS),DRPLDE(NTENS),
     2 STRAN(NTENS),DSTRAN(NTENS),TIME(2),PREDEF(1),DPRED(1),
     3 PROPS(NPROPS),COORDS(3),DROT(3,3),DFGRD0(3,3),DFGRD1(3,3),
     4 JSTEP(4)
      DIMENSION B(3,3),S(3,3),D(3,3),IR(6),IC(6)
      DATA IR/1,2,3,1,1,2/, IC/1,2,3,2,3,3/
      DATA D/1.D0,0.D0,0.D0,0.D0,1.D0,0.D0,0.D0,0.D0,1.D0/
C
      ALAM = PROPS(1)
      AMU = PROPS(2)
C     Cofactors of the first row.
      C11 = DFGRD1(2,2)*DFGRD1(3,3) - DFGRD1(2,3)*DFGRD1(3,2)
      C12 = DFGRD1(2,3)*DFGRD1(3,1) - DFGRD1(2,1)*DFGRD1(3,3)
      C13 = DFGRD1(2,1)*DFGRD1(3,2) - DFGRD1(2,2)*DFGRD1(3,1)
      DET = DFGRD1(1,1)*C11 + DFGRD1(1,2)*C12 + DFGRD1(1,3)*C13
      B = MATMUL(DFGRD1, TRANSPOSE(DFGRD1))
      S = (AMU*(B - D) + ALAM*LOG(DET)*D)/DET
      G = (AMU - ALAM*LOG(DET))/DET
      DO M = 1, NTENS
        I = IR(M)
        J = IC(M)
        STRESS(M) = S(I,J)
        DO N = 1, NTENS
          K = IR(N)
          L = IC(N)
C         Truesdell rate, then what makes it the Jaumann rate.
          DDSDDE(M,N) = ALAM/DET*D(I,J)*D(K,L)
     1      + G*(D(I,K)*D(J,L) + D(I,L)*D(J,K))
     2      + 0.5D0*(D(I,K)*S(J,L) + D(I,L)*S(J,K)
     3             + S(I,K)*D(J,L) + S(I,L)*D(J,K))
        END DO
      END DO
      SSE = AMU/2*(B(1,1)+B(2,2)+B(3,3)-3-2*LOG(DET))
     1    + ALAM/2*LOG(DET)**2
      RETURN
      END
